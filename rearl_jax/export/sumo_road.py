"""A straight road as a network file of SUMO."""

_LANE = '<lane id="road_{0}" index="{0}" speed="{1:g}" length="{2}" width="4" shape="0,{3} {2},{3}"/>'
_NETWORK = """<net version="1.20">
<location netOffset="0,0" convBoundary="0,{bottom:g},{length},0" origBoundary="0,0,0,0" projParameter="!"/>
<edge id="road" from="west" to="east" priority="1">{lanes}</edge>
<junction id="west" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,{bottom:g}"/>
<junction id="east" type="dead_end" x="{length}" y="0" incLanes="{names}" intLanes=""
          shape="{length},{bottom:g} {length},0"/>
</net>
"""


def draw_network(n_lanes: int, length: float, speed_limit: float) -> str:
    """A network file with one straight edge `road`, whose lanes SUMO counts from the right.

    Args:
        n_lanes: Number of lanes, each 4 m wide.
        length: Length of the road [m].
        speed_limit: Speed limit [m/s].
    """
    bottom = -4 * n_lanes
    lanes = "".join(_LANE.format(k, speed_limit, length, 4 * k + bottom + 2) for k in range(n_lanes))
    names = " ".join(f"road_{k}" for k in range(n_lanes))
    return _NETWORK.format(length=length, lanes=lanes, names=names, bottom=bottom)
