"""The torque of weights on an axis: the links that load it, their gear ratios, and the unit of its angle."""
