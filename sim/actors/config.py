# SPDX-License-Identifier: Apache-2.0
"""The numbers of everything that moves: doors, people, chairs, and the robot's driver.

``mobilia config actors`` prints them. They are part of what a seed means, and compiled into the
kernels of the world: so they are fixed, and the same in every run.
"""

from collections import namedtuple
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar, cast

from slam.settings import BY_HAND, Settings, number

S = TypeVar("S", bound=Settings)


def _fixed(default: float, unit: str, meaning: str, source: str = BY_HAND) -> Any:
    return number(default, unit, meaning, source, low=-1e6, fixed=True)


@dataclass(frozen=True, kw_only=True)
class DoorConfig(Settings):
    """Doors, and for whom they open."""

    opened_rad: float = _fixed(1.5, "rad", "where a hand opens to")
    passable_rad: float = _fixed(1.15, "rad", "a leaf this far open lets a person through")
    rate_max: float = _fixed(1.4, "rad/s", "a door pushed open takes little more than a second")
    rate_gain: float = _fixed(3.0, "1/s", "rate by what is left to turn")
    torque_gain: float = _fixed(8.0, "1/s", "torque by the missing rate, over inertia")
    torque_max: float = _fixed(40.0, "N m", "against spring and damper; 45 N at the handle")
    rest_step: float = _fixed(0.75, "rad", "between closed, ajar and open")
    near_m: float = _fixed(1.6, "m", "a robot this near that faces the doorway is let through")
    facing: float = _fixed(0.3, "cosine", "of facing it")
    clear_m: float = _fixed(0.95, "m", "no door is let go with someone this near its middle")
    held_s: float = _fixed(0.5, "s", "it is kept open after someone asked")
    event_least_s: float = _fixed(3.0, "s", "an event lasts, at least")
    event_most_s: float = _fixed(9.0, "s", "an event lasts, at most")
    slide_max: float = _fixed(0.7, "m/s", "a sliding door opens at this pace, at most")
    slide_opened: float = _fixed(0.96, "share", "of its way: where it stands open")
    slide_shut_m: float = _fixed(0.02, "m", "less open, a sliding door is shut")
    slide_stopped_m: float = _fixed(0.10, "m", "more open than this and still: it met something")
    slide_still_mps: float = _fixed(0.02, "m/s", "slower, its leaf is still")
    slide_starts_s: float = _fixed(0.5, "s", "its leaf has to get going")
    slide_held_s: float = _fixed(1.0, "s", "it is kept open after the last who asked")
    lift_s: float = _fixed(3.5, "s", "from a call to the cabin's arrival")
    lift_held_s: float = _fixed(3.0, "s", "a lift stands open at least")


@dataclass(frozen=True, kw_only=True)
class RightOfWayConfig(Settings):
    """Who passes a door first, and where the others wait."""

    body_m: float = _fixed(0.27, "m", "clearance a person keeps to walls")
    wants_m: float = _fixed(2.2, "m", "a door this near may be on one's way")
    in_doorway_m: float = _fixed(0.35, "m", "one is in the doorway: the flow field decides")
    on_way: float = _fixed(0.8, "s/m", "less time saved by the distance: not on the way")
    swept_m2: float = _fixed(1.6, "m²", "nobody within this of the moving leaf's middle")
    in_frame_m: float = _fixed(0.4, "m", "across the door: in its frame")
    kept_m: float = _fixed(1.4, "m", "whose turn it is keeps it this near")
    pull_m: float = _fixed(2.1, "m", "who pulls a door asks for it from here")
    push_m: float = _fixed(1.5, "m", "who pushes it from here")
    beside_m: float = _fixed(0.8, "m", "beside the door, where one waits")
    back_m: float = _fixed(1.2, "m", "and this far before it")
    wait_mps: float = _fixed(1.0, "m/s", "speed to that place, at most")
    wait_gain: float = _fixed(1.5, "1/s", "speed by what is left")
    leaf_m: float = _fixed(0.32, "m", "beyond the leaf's circle for who pulls")
    push_stop_m: float = _fixed(0.45, "m", "before the leaf for who pushes")
    queue_m: float = _fixed(0.65, "m", "for each one who is ahead")
    round_m: float = _fixed(1.0, "m", "a leaf so near in the way is walked round")
    round_end_m: float = _fixed(0.4, "m", "beyond its end")
    hold_gain: float = _fixed(2.0, "1/s", "speed towards the leaf by the distance left")
    hold_mps: float = _fixed(2.0, "m/s", "taken off one's speed, at most")


@dataclass(frozen=True, kw_only=True)
class SteeringConfig(Settings):
    """How people choose their velocity among others; weights are costs per unit."""

    horizon_s: float = _fixed(2.5, "s", "collisions later than this do not matter")
    accel: float = _fixed(3.0, "m/s²", "of a person")
    spare_m: float = _fixed(0.05, "m", "between people and the robot")
    spare_mps: float = _fixed(2.0, "m/s", "taken off one's speed for it, at most")
    apart_m: float = _fixed(0.06, "m", "added to the hulls of two that meet")
    touching: float = _fixed(4.0, "s/m", "weight of closing in on what one touches")
    soon_s: float = _fixed(0.1, "s", "added to the time of a collision: bounds its cost")
    least_pace: float = _fixed(0.5, "m/s", "of the velocities that are tried")
    hurry: float = _fixed(1.5, "1/s", "weight of slowness by the time held up")
    hurry_most: float = _fixed(3.0, "cost", "of it")
    hurry_from: float = _fixed(0.3, "m/s", "slower wishes are in no hurry")
    change: float = _fixed(0.15, "s/m", "weight of a change of velocity")
    keep_right: float = _fixed(0.06, "s²/m²", "weight of passing on the left")
    slow: float = _fixed(0.9, "share", "of the pace: below it one is slow")
    look_s: float = _fixed(0.3, "s", "between the two looks at walls ahead")
    wall: float = _fixed(25.0, "1/m", "weight of clearance lost")
    dense: float = _fixed(0.5, "share", "weight of other people where there is a crowd")
    crowd_spare_m: float = _fixed(0.12, "m", "between those of a crowd and the robot")
    held_spare_m: float = _fixed(0.1, "m", "added for what one holds")
    held_brake: float = _fixed(0.7, "m/s²", "with which that stops before the robot")
    crowd_brake: float = _fixed(1.5, "m/s²", "with which those of a crowd stop before the robot")
    lane_half_m: float = _fixed(1.35, "m", "clearance in a corridor, where streams keep right")
    lane: float = _fixed(0.35, "share", "of the pace, to the right there")
    lane_side_m: float = _fixed(0.4, "m", "to the right, where there is to be room for it")
    lane_wall_m: float = _fixed(0.32, "m", "clearance there")


@dataclass(frozen=True, kw_only=True)
class WalkingConfig(Settings):
    """Trips of people, and their patience."""

    speed_mps: float = _fixed(1.34, "m/s", "preferred speed, mean", "PedSim")
    speed_sd: float = _fixed(0.26, "m/s", "preferred speed, standard deviation", "PedSim")
    speed_least: float = _fixed(0.8, "m/s", "preferred speed, at least")
    speed_most: float = _fixed(1.9, "m/s", "preferred speed, at most")
    first_stay_s: float = _fixed(8.0, "s", "the first stay, at most: a short run sees people go")
    arrive_least_s: float = _fixed(0.25, "s", "from the goal one has arrived, at least")
    arrive_most_s: float = _fixed(0.8, "s", "from the goal one has arrived, at most")
    look_least_s: float = _fixed(4.0, "s", "one looks one way while standing, at least")
    look_most_s: float = _fixed(15.0, "s", "one looks one way while standing, at most")
    still_mps: float = _fixed(0.1, "m/s", "a walker slower than this is blocked")
    doorway_m: float = _fixed(1.2, "m", "nearer to a door nobody arrives")
    near_s: float = _fixed(2.0, "s", "from the goal, a blocked one has arrived")
    near_blocked_s: float = _fixed(0.8, "s", "blocked for so long")
    blocked_s: float = _fixed(5.0, "s", "blocked: another goal")
    crowd_blocked_s: float = _fixed(2.0, "s", "the same in a crowd")
    patient_s: float = _fixed(0.8, "s", "held up by a chair or a leaf so long, one begins to push")
    crowd_patient_s: float = _fixed(0.3, "s", "the same in a crowd")
    no_progress_s: float = _fixed(12.0, "s", "without progress: another goal")
    turn_gain: float = _fixed(4.0, "1/s", "turn rate by the angle left")
    turn_most: float = _fixed(3.0, "rad/s", "turn rate, at most")


@dataclass(frozen=True, kw_only=True)
class SittingConfig(Settings):
    """Chairs that people sit down on."""

    share: float = _fixed(0.2, "share", "of arrivals with a free chair at hand that end on it")
    hand_m: float = _fixed(2.5, "m", "a chair this near is at hand")
    stay: float = _fixed(3.0, "ratio", "of a stay, over that of who stands")
    down_s: float = _fixed(0.8, "s", "to sit down, and to get up")
    near_m: float = _fixed(0.08, "m", "between hulls from where one turns and sits down")
    room_m: float = _fixed(0.18, "m", "clearance of a chair, else it is tucked under a desk")
    pace_mps: float = _fixed(0.7, "m/s", "to the chair")
    give_up_s: float = _fixed(1.5, "s", "held up on the way: then not")


@dataclass(frozen=True, kw_only=True)
class FollowingConfig(Settings):
    """People who accompany the robot or each other, and lines of them."""

    crumb_m: float = _fixed(0.25, "m", "between two remembered places of a leader's way")
    course_rate: float = _fixed(0.8, "rad/s", "the formation turns after its leader, at most")
    moving_mps: float = _fixed(0.15, "m/s", "a leader slower than this stands")
    give_way_s: float = _fixed(1.5, "s", "a leader stands so long: those around it step back")
    step_back: float = _fixed(0.6, "m/s", "as fast as this")
    step_back_m: float = _fixed(1.6, "m", "so far, at most")
    margin_m: float = _fixed(0.3, "m", "clearance of a place in the formation")
    sight_m: float = _fixed(0.2, "m", "clearance of a line of sight")
    wide_m: float = _fixed(0.5, "m", "clearance half way to one's place, else one goes in file")
    gain: float = _fixed(1.5, "1/s", "speed by the distance left")
    fastest_mps: float = _fixed(1.8, "m/s", "to catch up")
    narrow_m: float = _fixed(0.75, "m", "less clearance is a doorway or a corridor")
    narrow_side_m: float = _fixed(0.35, "m", "from the wall there")
    asked_s: float = _fixed(0.4, "s", "somebody else is held up so long: one makes room")
    room_m: float = _fixed(1.3, "m", "before somebody who walks")
    room_push_m: float = _fixed(3.2, "m", "before somebody who pushes something long")
    room_half_m: float = _fixed(0.6, "m", "to both sides")
    way_m: float = _fixed(1.5, "m", "before the robot, its way is left free")
    way_half_m: float = _fixed(0.5, "m", "to both sides")
    aside_mps: float = _fixed(0.8, "m/s", "out of its way")
    crossing_m2: float = _fixed(0.5, "m²", "two take each other's place to save this much")
    held_up_s: float = _fixed(0.6, "s", "held up so long near one's place: one rests there")
    near_m: float = _fixed(2.2, "m", "near one's place")
    rest_s: float = _fixed(1.5, "s", "of that rest")
    taken_m: float = _fixed(1.5, "m", "so near a place that is taken one has arrived")
    stands_s: float = _fixed(1.0, "s", "a leader stands so long: its company waits where it is")
    stands_m: float = _fixed(4.0, "m", "near one's place, while the leader stands")
    file_m: float = _fixed(0.5, "m", "to one of one's own company: one slows down behind it")
    file_gap_m: float = _fixed(0.1, "m", "left to it")
    file_half: float = _fixed(0.7, "share", "of both radii to the side: it is right before one")
    there_m: float = _fixed(0.15, "m", "so near one has arrived")
    asks_m: float = _fixed(1.4, "m", "a door this near is opened for those who follow")
    served_s: float = _fixed(12.0, "s", "between two who are served in a queue")


@dataclass(frozen=True, kw_only=True)
class HoldingConfig(Settings):
    """Hands on what is pushed, pulled or carried: springs with dampers, bounded."""

    stiffness: float = _fixed(9.0, "1/s²", "force by the distance, over the mass of the thing")
    damping: float = _fixed(6.0, "1/s", "force by the speed, over the mass of the thing")
    force_max: float = _fixed(180.0, "N", "of two hands, at most")
    torque_max: float = _fixed(120.0, "N m", "of two hands, at most")
    lost_m: float = _fixed(0.8, "m", "farther from the hand a thing is let go")
    turn_most: float = _fixed(0.8, "rad/s", "turn rate of who pushes something long")
    sight_m: float = _fixed(4.5, "m", "what is farther away does not matter to who pushes")
    stop_m: float = _fixed(0.1, "m", "before what stands in its way")
    stop_robot_m: float = _fixed(0.25, "m", "before the robot")
    stop_wall_m: float = _fixed(0.03, "m", "before a wall")
    step_s: float = _fixed(0.4, "s", "of a look ahead; 4 of them")
    sees_s: float = _fixed(0.8, "s", "what moves is taken to go on so long")
    backwards_mps: float = _fixed(0.5, "m/s", "pulling a long thing back, at most")
    backwards: float = _fixed(0.4, "share", "of the way made so: one rather turns it round")
    hit: float = _fixed(10.0, "s", "weight of running into something")
    close_m: float = _fixed(0.3, "m", "clearance beyond this gains nothing")
    close: float = _fixed(0.5, "s/m", "weight of clearance")
    turning: float = _fixed(0.05, "s²/rad", "weight of turning")
    hurry: float = _fixed(0.6, "1", "weight of standing by the time held up")
    hurry_most: float = _fixed(3.0, "s", "of it")
    slack_m: float = _fixed(0.1, "m", "a thing lags behind the hand at no matter")
    taut_m: float = _fixed(0.35, "m", "farther behind it is waited for, and gone back to")
    taut_gain: float = _fixed(3.0, "1/s", "speed away from it by what is left to that")


@dataclass(frozen=True, kw_only=True)
class CleaningConfig(Settings):
    """Who takes chairs from place to place."""

    hand_m: float = _fixed(6.0, "m", "a chair this near is taken next")
    near_m: float = _fixed(0.12, "m", "between hulls from where it is taken")
    rest_s: float = _fixed(1.5, "s", "between putting one down and taking the next")
    pace_mps: float = _fixed(0.8, "m/s", "to a chair and with it")
    there_m: float = _fixed(0.12, "m", "from its place it is put down")
    trip_s: float = _fixed(25.0, "s", "of a way that is given up then")


@dataclass(frozen=True, kw_only=True)
class ChairConfig(Settings):
    """Chairs that are pushed or rolled by nobody in sight."""

    push_least_ticks: int = _fixed(9, "ticks", "of a push, at least: 0.12 s")
    push_most_ticks: int = _fixed(26, "ticks", "of a push, at most: 0.35 s")
    impulse_max: float = _fixed(45.0, "N s", "what is heavier gets less speed")
    turn_s: float = _fixed(4.0, "s", "a chair is rolled at a time")
    brake_s: float = _fixed(0.3, "s", "at the end of it, in which it is stopped")
    slowest_mps: float = _fixed(0.3, "m/s", "of rolling, at least")
    fastest_mps: float = _fixed(0.9, "m/s", "of rolling, at most")
    spin_max: float = _fixed(1.0, "rad/s", "of rolling")
    patience_s: float = _fixed(0.25, "s", "held up: pushed another way")
    tau_s: float = _fixed(0.08, "s", "time constant of the push")
    accel_max: float = _fixed(8.0, "m/s²", "bounds the force")


@dataclass(frozen=True, kw_only=True)
class DriverConfig(Settings):
    """How the robot's driver scores a command, and when it plans again."""

    step_s: float = _fixed(0.15, "s", "of the rollout; 14 of them")
    look_ahead_m: float = _fixed(0.35, "m", "where the cost-to-go is asked for as well")
    accel: float = _fixed(1.0, "m/s²", "ramp of the drive", "sim.actors.robot.DriveConfig")
    alpha: float = _fixed(3.0, "rad/s²", "ramp of the drive", "sim.actors.robot.DriveConfig")
    overlap_m: float = _fixed(0.02, "m", "a start in overlap may be driven out of")
    run_over: float = _fixed(3.0, "cost", "of being run over while standing")
    ahead: float = _fixed(1.5, "weight", "of the cost-to-go ahead")
    free: float = _fixed(0.5, "1/m", "weight of clearance")
    free_m: float = _fixed(0.35, "m", "clearance beyond this gains nothing")
    turning: float = _fixed(0.02, "s/rad", "weight of turning")
    reverse: float = _fixed(0.3, "share", "of the speed limit, backwards")
    standing: float = _fixed(0.25, "cost", "of standing or reversing")
    sight_m: float = _fixed(4.0, "m", "discs farther away do not matter")
    ajar_rad: float = _fixed(0.6, "rad", "a leaf less open is let open for the robot")
    replan_s: float = _fixed(1.0, "s", "between two plans, at least")
    decide_s: float = _fixed(0.07, "s", "a command holds, at least")
    leaf_discs: int = _fixed(6, "discs", "along a leaf that is avoided")
    leaf_m: float = _fixed(0.05, "m", "half thickness of a leaf in plans")


@dataclass(frozen=True, kw_only=True)
class ActorsConfig(Settings):
    """All of them."""

    doors: DoorConfig = field(default=DoorConfig())
    right_of_way: RightOfWayConfig = field(default=RightOfWayConfig())
    steering: SteeringConfig = field(default=SteeringConfig())
    walking: WalkingConfig = field(default=WalkingConfig())
    sitting: SittingConfig = field(default=SittingConfig())
    following: FollowingConfig = field(default=FollowingConfig())
    holding: HoldingConfig = field(default=HoldingConfig())
    cleaning: CleaningConfig = field(default=CleaningConfig())
    chairs: ChairConfig = field(default=ChairConfig())
    driver: DriverConfig = field(default=DriverConfig())


ACTORS = ActorsConfig()


def _constants(numbers: S) -> S:
    """The same numbers as a named tuple, which kernels take as constants."""
    kind = namedtuple(type(numbers).__name__, [field.name for field in fields(numbers)])  # type: ignore[misc]
    return cast(S, kind(**numbers.as_words()))


DOORS, WAY = _constants(ACTORS.doors), _constants(ACTORS.right_of_way)
STEER, WALK = _constants(ACTORS.steering), _constants(ACTORS.walking)
SIT, FOLLOW = _constants(ACTORS.sitting), _constants(ACTORS.following)
HOLD, CLEAN = _constants(ACTORS.holding), _constants(ACTORS.cleaning)
CHAIRS, DRIVE = _constants(ACTORS.chairs), _constants(ACTORS.driver)
