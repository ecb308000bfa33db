// Converts the components of a drive to a chain: masses that turn together, what acts on them, and what connects them.
import type { Body } from "./ask";

export type DriveModel = Body<"DriveModel">;
export type Component = Body<"Component">;

/** A shaft: components that turn together, and those that act on them. */
export interface Shaft {
  masses: Component[];
  /** Torques, friction, weights, sensors. */
  attached: Component[];
}

export interface Stage {
  /** Components that connect it to the stage before; empty: it is the first one. */
  links: Component[];
  shaft: Shaft;
}

/** A row of stages; the first stage of a branch is connected to the shaft of `from`. */
export interface Row {
  from: Shaft | null;
  stages: Stage[];
}

interface Link {
  ends: [string, string];
  parts: Component[];
}

/** The rows of a drive, from its motor outwards; the longest path is the first row, each branch is a further row. */
export function chainOf(components: Component[]): Row[] {
  const nodes = new Joined();
  for (const c of components) for (const node of c.nodes) nodes.root(node);
  for (const c of components) if (c.kind === "inertia") nodes.join(c.nodes);
  const fixed = new Set(components.filter((c) => c.kind === "fixed").flatMap((c) => c.nodes.map((n) => nodes.root(n))));
  const shafts = new Map<string, Shaft>();
  const links: Link[] = [];
  const shaftAt = (root: string): Shaft => {
    const known = shafts.get(root) ?? { masses: [], attached: [] };
    shafts.set(root, known);
    return known;
  };
  for (const c of components) {
    const ends = [...new Set(c.nodes.map((n) => nodes.root(n)))].filter((root) => !fixed.has(root));
    const [a, b] = ends;
    if (a === undefined) continue;
    // A damper to the ground is friction.
    if (b === undefined && c.kind === "damper") shaftAt(a).attached.push({ ...c, kind: "viscous-friction" });
    else if (b === undefined) (c.kind === "inertia" ? shaftAt(a).masses : shaftAt(a).attached).push(c);
    else {
      const known = links.find((link) => link.ends.includes(a) && link.ends.includes(b));
      if (known) known.parts.push(c);
      else links.push({ ends: [a, b], parts: [c] });
      shaftAt(a);
      shaftAt(b);
    }
  }
  const at = (kind: string): string | undefined => {
    const [node] = components.find((c) => c.kind === kind)?.nodes ?? [];
    return node === undefined ? undefined : nodes.root(node);
  };
  const motor = at("torque");
  // A gain of the torque signal is not drawn separately.
  if (motor !== undefined) shafts.get(motor)?.attached.unshift(...components.filter((c) => c.kind === "gain"));
  return rowsOf(shafts, links, motor ?? at("inertia"));
}

function rowsOf(shafts: Map<string, Shaft>, links: Link[], first: string | undefined): Row[] {
  const rows: Row[] = [];
  const seen = new Set<string>();
  const others = (root: string): [Link, string][] =>
    links.flatMap((link): [Link, string][] => {
      const [a, b] = link.ends;
      return a === root ? [[link, b]] : b === root ? [[link, a]] : [];
    });
  const depth = (root: string, before: Set<string>): number => {
    const passed = new Set([...before, root]);
    return 1 + Math.max(0, ...others(root).filter(([, to]) => !passed.has(to)).map(([, to]) => depth(to, passed)));
  };
  const walk = (root: string, parts: Component[], row: Row): void => {
    seen.add(root);
    const shaft = shafts.get(root) as Shaft;
    row.stages.push({ links: parts, shaft });
    const ahead = others(root).filter(([, to]) => !seen.has(to));
    ahead.sort(([, a], [, b]) => depth(b, seen) - depth(a, seen));
    ahead.forEach(([link, to], i) => {
      if (seen.has(to)) return;
      const next: Row = i === 0 ? row : { from: shaft, stages: [] };
      if (i > 0) rows.push(next);
      walk(to, link.parts, next);
    });
  };
  for (const root of [...(first === undefined ? [] : [first]), ...shafts.keys()]) {
    if (seen.has(root)) continue;
    const row: Row = { from: null, stages: [] };
    rows.push(row);
    walk(root, [], row);
  }
  return rows;
}

/** Nodes, and the sets of nodes that are connected. */
class Joined {
  private readonly above = new Map<string, string>();

  root(node: string): string {
    const next = this.above.get(node);
    if (next === undefined) this.above.set(node, node);
    return next === undefined || next === node ? node : this.root(next);
  }

  join([first, ...others]: string[]): void {
    for (const other of others) if (first !== undefined) this.above.set(this.root(other), this.root(first));
  }
}

/** The monitored parameters of a component. */
export const monitoredIn = (c: Component, model: DriveModel): string[] => {
  const names = new Set(c.parameters.flatMap((p) => p.names));
  return model.monitored.filter((m) => m.names.some((name) => names.has(name))).map((m) => m.name);
};

/** Monitored parameters of no component: the delay of the torque, a load that is not in the drawing. */
export const placeless = (model: DriveModel): string[] => {
  const placed = new Set(model.components.flatMap((c) => monitoredIn(c, model)));
  return model.monitored.map((m) => m.name).filter((name) => !placed.has(name));
};
