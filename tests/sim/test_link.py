"""The radio channel: maps arrive late, robots that nobody hears come back, and the checker agrees."""

from __future__ import annotations

from react_opt.certify_trace import check_trace
from react_opt.instance import Link
from react_opt.sim.link import PACKET_BITS, PIXEL_BITS
from react_opt.sim.loop import Simulation
from tests.sim.missions import TWO_ROOMS, mission

STARTS = [(1.5, 1.5), (1.5, 4.0)]


def test_nothing_arrives_during_an_outage_and_all_of_it_afterwards() -> None:
    link = Link(x_m=1.0, y_m=1.0, range_m=50.0, rate_bit_s=1e9, outages_s=((5.0, 20.0),))
    of = mission(STARTS, link=link, horizon_s=90.0)
    trace = Simulation(of, TWO_ROOMS).run()
    shares = {frame.t_s: frame.coverage for frame in trace.frames}
    assert shares[5.0] == shares[19.0]
    assert shares[21.0] > shares[19.0]
    assert [(e.t_s, e.type) for e in trace.events if e.robot == "r1" and e.type.startswith("link")] == [
        (5.0, "link_down"),
        (20.0, "link_up"),
    ]
    assert trace.frames[-1].coverage > 0.97
    assert check_trace(of, trace, TWO_ROOMS.cells).violations == ()


def test_a_slow_channel_delays_the_map_by_its_size_over_its_rate() -> None:
    fast = Simulation(mission(STARTS[:1], horizon_s=1.0), TWO_ROOMS).run()
    first = int((fast.known.array("<u2") == 0).sum())
    seconds = (PACKET_BITS + PIXEL_BITS * first) / 2e4
    link = Link(x_m=1.5, y_m=1.5, range_m=1e3, rate_bit_s=2e4)
    slow = Simulation(mission(STARTS[:1], link=link, horizon_s=60.0), TWO_ROOMS).run()
    learnt = min(frame.t_s for frame in slow.frames if frame.coverage > 0)
    assert seconds - 0.5 <= learnt <= seconds + 1.0


def test_a_robot_out_of_range_comes_back_to_where_it_was_heard() -> None:
    link = Link(x_m=1.0, y_m=1.0, range_m=6.0, rate_bit_s=1e9)
    trace = Simulation(mission(STARTS[:1], link=link, horizon_s=90.0), TWO_ROOMS).run()
    turns = [event.type for event in trace.events if event.type.startswith("link")]
    assert turns[:2] == ["link_down", "link_up"]
    assert trace.frames[-1].coverage > 0.8


def test_what_a_dead_robot_had_not_sent_is_lost() -> None:
    link = Link(x_m=1.0, y_m=1.0, range_m=50.0, rate_bit_s=1e9, outages_s=((0.0, 90.0),))
    of = mission(STARTS[:1], link=link, failures=[{"robot": "r1", "t_s": 3.0}])
    trace = Simulation(of, TWO_ROOMS).run()
    assert trace.frames[-1].coverage == 0
    assert trace.frames[-1].t_s == 3.0
