"""Watches a live run by the protocol of Foxglove, and compares what it saw with the recording, by the mcap package.

Usage: read_live.py watch ADDRESS SEEN
       read_live.py compare SEEN RECORDING
`watch` pauses the run, steps it, changes its pace and resumes it, and writes what it saw to SEEN, as JSON.
"""

import asyncio
import base64
import json
import struct
import sys

from expected import fail
from mcap.reader import make_reader
from robo_ws_bridge import PlaybackCommand, PlaybackState, PlaybackStatus, WebSocketBridgeClient
from robo_ws_bridge.ws_types import BinaryOpCodes

REQUEST = struct.Struct("<BBfBQI")
STATE = struct.Struct("<BBQfBI")
# Messages that each topic has to send before the run is steered.
ENOUGH = 20
TIMEOUT_S = 60
# Time in which a paused run would send messages, if it were not.
SILENCE_S = 1


class Watcher(WebSocketBridgeClient):
    """A client that notes all that comes, states of playback too."""

    def __init__(self, address):
        super().__init__(address)
        self.messages, self.times, self.states, self.notices = {}, [], [], []
        self.on_advertised_channel(lambda channel: self.subscribe(channel["topic"]))
        self.on_message(self._take)
        self.on_time_update(self.times.append)
        self.on_status(lambda level, text, name: self.notices.append(text))

    def _take(self, channel, time_ns, data):
        self.messages.setdefault(channel["topic"], []).append((time_ns, data))

    async def _handle_binary(self, data):
        if data[0] != BinaryOpCodes.PLAYBACK_STATE:
            return await super()._handle_binary(data)
        _, status, time_ns, speed, did_seek, length = STATE.unpack_from(data)
        name = data[STATE.size : STATE.size + length].decode() or None
        self.states.append(PlaybackState(PlaybackStatus(status), time_ns, speed, bool(did_seek), name))

    async def ask(self, name, command, speed=1.0, seek_ns=None):
        """The state of the run with which the server answers."""
        asked = (BinaryOpCodes.PLAYBACK_CONTROL_REQUEST, command, speed, seek_ns is not None, seek_ns or 0, len(name))
        await self._websocket.send(REQUEST.pack(*asked) + name.encode())
        return await self.until(lambda: next((state for state in self.states if state.request_id == name), None), name)

    async def shows(self, status, speed=1.0):
        """Waits until the newest state has this status and this speed: a busy run answers later than the server."""
        is_meant = lambda state: (state.status, state.playback_speed) == (status, speed)
        await self.until(lambda: is_meant(self.states[-1]), f"a state {status} at speed {speed}")

    async def silence(self):
        """Waits until nothing has come for a while."""
        before = None
        while before != self.counts():
            before = self.counts()
            await asyncio.sleep(SILENCE_S)

    async def until(self, look, what):
        for _ in range(TIMEOUT_S * 100):
            if found := look():
                return found
            await asyncio.sleep(0.01)
        fail(f"{what}: it has not come within {TIMEOUT_S} s; {self.counts()}, {self.states[-3:]}, {self.notices}")

    def counts(self):
        return {topic: len(messages) for topic, messages in self.messages.items()}

    def newest_ns(self):
        return max(messages[-1][0] for messages in self.messages.values())


async def watch(address):
    watcher = Watcher(address)
    await watcher.connect()
    # A busy server may tell of its topics one after the other.
    is_seen = lambda: 0 < len(watcher.channels) == len(watcher.messages) and min(watcher.counts().values()) >= ENOUGH
    await watcher.until(is_seen, "messages")
    channels = dict(watcher.channels)

    await watcher.ask("pause", PlaybackCommand.PAUSE)
    await watcher.shows(PlaybackStatus.PAUSED)
    # Samples of the last ticks may be under way.
    await watcher.silence()
    held, held_ns = watcher.counts(), watcher.newest_ns()
    await asyncio.sleep(SILENCE_S)
    if watcher.counts() != held:
        fail(f"a paused run sends messages: {held}, {watcher.counts()}")

    late = Watcher(address)
    await late.connect()
    await late.until(lambda: len(late.messages) == len(channels), "the newest message of each topic")
    await late.silence()
    if set(late.counts().values()) != {1} or late.newest_ns() != held_ns:
        fail(f"a client that came later has not the newest messages: {late.counts()}, {late.newest_ns()}, {held_ns}")
    await late.disconnect()

    await watcher.ask("step", PlaybackCommand.PAUSE, seek_ns=held_ns + 51_000_000)
    await watcher.until(lambda: watcher.newest_ns() == held_ns + 50_000_000, "fifty ticks more")
    await watcher.ask("back", PlaybackCommand.PAUSE, seek_ns=0)
    await watcher.until(lambda: any("ctl rewind" in text for text in watcher.notices), "the refusal to go back")
    await watcher.ask("faster", PlaybackCommand.PLAY, speed=2.0)
    await watcher.shows(PlaybackStatus.PLAYING, 2.0)
    await watcher.until(lambda: watcher.newest_ns() > held_ns + 500_000_000, "messages of the resumed run")
    info = watcher.server_info
    await watcher.disconnect()
    return {
        "info": info,
        "channels": list(channels.values()),
        "messages": {
            topic: [(time_ns, base64.b64encode(data).decode()) for time_ns, data in messages]
            for topic, messages in watcher.messages.items()
        },
        "times": watcher.times,
        "held_ns": held_ns,
    }


def compare(seen, path):
    """Each topic is declared as in the recording, and each message is one of the recording, byte by byte."""
    with open(path, "rb") as file:
        summary = make_reader(file).get_summary()
        recorded = {channel.topic: channel for channel in summary.channels.values()}
        messages = {(c.topic, m.log_time): m.data for _, c, m in make_reader(file).iter_messages()}
    shown = {channel["topic"]: channel for channel in seen["channels"]}
    if shown.keys() != recorded.keys():
        fail(f"the server has the topics {sorted(shown)}, the recording has {sorted(recorded)}")
    for topic, channel in recorded.items():
        schema = summary.schemas[channel.schema_id]
        wanted = (channel.message_encoding, schema.name, schema.encoding, schema.data.decode())
        found = tuple(shown[topic].get(key) for key in ("encoding", "schemaName", "schemaEncoding", "schema"))
        if found != wanted:
            fail(f"{topic}: the server declares {found}, the recording {wanted}")
    count = 0
    for topic, sent in seen["messages"].items():
        for time_ns, data in sent:
            if messages.get((topic, time_ns)) != base64.b64decode(data):
                fail(f"{topic} at {time_ns} ns: the recording has another message, or none")
            count += 1
        times = [time_ns for time_ns, _ in sent]
        if times != sorted(set(times)):
            fail(f"{topic}: times do not rise: {[pair for pair in zip(times, times[1:]) if pair[0] >= pair[1]]}")
    if not count or seen["times"] != sorted(set(seen["times"])):
        fail(f"{count} messages; times of the server: {seen['times'][:20]}")
    print(f"robo-ws-bridge: {len(shown)} topics, {count} messages equal the recording")


def main(what, *arguments):
    if what == "watch":
        address, path = arguments
        with open(path, "w", encoding="utf-8") as file:
            json.dump(asyncio.run(watch(address)), file)
    else:
        with open(arguments[0], encoding="utf-8") as file:
            compare(json.load(file), arguments[1])


main(*sys.argv[1:])
