package Modelica "The part of the standard library that the drives of these tests use, written from its documentation"
  package Units
    package SI
      type Angle = Real;
      type AngularVelocity = Real;
      type AngularAcceleration = Real;
      type Torque = Real;
      type Inertia = Real;
      type RotationalSpringConstant = Real;
      type RotationalDampingConstant = Real;
    end SI;
  end Units;

  package Blocks
    package Interfaces
      connector RealInput = input Real;
      connector RealOutput = output Real;
    end Interfaces;

    package Math
      model Gain
        parameter Real k;
        Interfaces.RealInput u;
        Interfaces.RealOutput y;
      equation
        y = k * u;
      end Gain;
    end Math;
  end Blocks;

  package Mechanics
    package Rotational
      package Interfaces
        connector Flange_a
          Real phi "angle";
          flow Real tau "torque into the component";
        end Flange_a;

        connector Flange_b
          Real phi "angle";
          flow Real tau "torque into the component";
        end Flange_b;
      end Interfaces;

      package Components
        model Fixed
          parameter Real phi0 = 0;
          Interfaces.Flange_b flange;
        equation
          flange.phi = phi0;
        end Fixed;

        model Inertia
          parameter Real J;
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
          Real phi;
          Real w;
          Real a;
        equation
          flange_a.phi = phi;
          flange_b.phi = phi;
          der(phi) = w;
          der(w) = a;
          flange_a.tau + flange_b.tau = J * a;
        end Inertia;

        partial model Between "Twisted by an angle, with no mass: what goes in at one end comes out at the other"
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
          Real phi_rel;
          Real tau;
        equation
          flange_b.phi = flange_a.phi + phi_rel;
          tau = flange_b.tau;
          0 = flange_a.tau + flange_b.tau;
        end Between;

        model Spring
          extends Between;
          parameter Real c;
          parameter Real phi_rel0 = 0;
        equation
          tau = (phi_rel - phi_rel0) * c;
        end Spring;

        model Damper
          extends Between;
          parameter Real d;
          Real w_rel;
          Real a_rel;
        equation
          w_rel = der(phi_rel);
          a_rel = der(w_rel);
          tau - d * w_rel = 0;
        end Damper;

        model SpringDamper
          extends Between;
          parameter Real c;
          parameter Real d;
          parameter Real phi_rel0 = 0;
          Real w_rel;
          Real a_rel;
          Real tau_c;
          Real tau_d;
        equation
          der(phi_rel) = w_rel;
          der(w_rel) = a_rel;
          tau_c = c * (phi_rel - phi_rel0);
          tau_d = d * w_rel;
          tau = tau_c + tau_d;
        end SpringDamper;

        model IdealGear
          parameter Real ratio "angle at flange_a over angle at flange_b";
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
          Real phi_a;
          Real phi_b;
        equation
          phi_a = flange_a.phi;
          phi_b = flange_b.phi;
          phi_a / ratio = phi_b;
          flange_b.tau = -ratio * flange_a.tau;
        end IdealGear;
      end Components;

      package Sources
        model Torque
          Blocks.Interfaces.RealInput tau;
          Interfaces.Flange_b flange;
        equation
          flange.tau = -tau;
        end Torque;
      end Sources;

      package Sensors
        model SpeedSensor
          Interfaces.Flange_a flange;
          Blocks.Interfaces.RealOutput w;
        equation
          w = der(flange.phi);
          flange.tau = 0;
        end SpeedSensor;

        model AngleSensor
          Interfaces.Flange_a flange;
          Blocks.Interfaces.RealOutput phi;
        equation
          phi = flange.phi;
          flange.tau = 0;
        end AngleSensor;
      end Sensors;
    end Rotational;
  end Mechanics;
end Modelica;
