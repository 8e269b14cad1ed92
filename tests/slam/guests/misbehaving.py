# SPDX-License-Identifier: Apache-2.0
"""A SLAM behind the pipe that does, at its third scan, what its argument says. Not a test."""

import json
import os
import signal
import sys
import time

EVER = 60.0  # longer than anybody waits


def say(**words: object) -> None:
    print(json.dumps(words), flush=True)


def estimate(stamp_ns: int, pose: list[float]) -> None:
    say(type="estimate", stamp_ns=stamp_ns, T_map_robot=pose)


def misbehave(fault: str, stamp_ns: int) -> bool:
    """True where it has answered, or what it takes for an answer."""
    if fault == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    elif fault == "exit":
        sys.stderr.write("out of\nideas\n")
        sys.exit(3)
    elif fault == "close":
        os.close(1)
        time.sleep(EVER)
    elif fault == "hang":
        time.sleep(EVER)
    elif fault == "spin":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        while True:
            pass
    elif fault == "half":
        sys.stdout.write('{"type":')
        sys.stdout.flush()
        time.sleep(EVER)
    elif fault == "chatter":
        sys.stderr.write("x" * 1_000_000 + "\n")
    elif fault == "twice":
        estimate(stamp_ns, [0, 0, 0])
    else:
        return answered(fault, stamp_ns)
    return False


def answered(fault: str, stamp_ns: int) -> bool:
    if fault == "garbage":
        print("Segmentation fault (just kidding)", flush=True)
    elif fault == "error":
        say(type="error", message="no idea\nat all")
    elif fault == "terminal":
        say(type="error", message="\x1b]0;owned\x07\x9b2J\u202e=1+1")
    elif fault == "other":
        say(type="map")
    elif fault == "nan":
        words = f'{{"type":"estimate","stamp_ns":{stamp_ns},"T_map_robot":[nan,0,0]}}'
        print(words, flush=True)
    elif fault == "short":
        estimate(stamp_ns, [1])
    elif fault == "stamp":
        estimate(1, [0, 0, 0])
    elif fault == "long":
        words = {"words": "x" * (1 << 22)}
        say(type="estimate", stamp_ns=stamp_ns, T_map_robot=[3, 0, 0], diagnostics=words)
    else:
        return False
    return True


def main(fault: str) -> None:
    count = 0
    for line in sys.stdin:
        message = json.loads(line)
        if message["type"] == "hello":
            if fault == "mute":
                time.sleep(EVER)
            version = 2 if fault == "future" else 1
            say(type="hello", protocol="mobilia-slam", version=version, map=fault == "map")
        elif message["type"] == "frame":
            count += 1
            if count == 1 and fault == "slow start":
                time.sleep(1.0)
            if count != 3 or not misbehave(fault, message["stamp_ns"]):
                estimate(message["stamp_ns"], [count, 0, 0])
        elif message["type"] == "reset":
            count = 0
            say(type="reset")
        elif message["type"] == "map":
            say(type="error", message="lost it")
        else:
            break


if __name__ == "__main__":
    main(sys.argv[1])
