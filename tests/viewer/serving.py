"""A server of the live view without a device, and clients of it by real sockets."""

import http.client
import json
import struct
import time

from painting import CAMERA, Painting, boxes
from websockets.sync.client import connect

from ispm.settings import Settings
from ispm.viewer.running import Running
from ispm.viewer.server import Server
from ispm.viewer.session import Session


class Site:
    """A server of a session that draws without a device, and what a browser does with it."""

    def __init__(self, seconds=0.01, **how):
        self.painting = Painting(seconds)
        make = lambda: Session(boxes(), self.painting, Settings(size=(64, 32), preset="fast"), CAMERA)  # noqa: E731
        self.running = Running(make, fps=50.0).start()
        self.spent = 0
        self.server = Server(self.running, spent=self._spend, **how)
        self.port = self.server.access.port
        self.host = f"127.0.0.1:{self.port}"
        self.cookie = ""

    def _spend(self):
        self.spent += 1

    def enter(self):
        answer = self.get("/?" + self.server.access.url().partition("?")[2])
        assert answer.status == 303
        self.cookie = answer.headers["set-cookie"].partition(";")[0]
        return answer

    def get(self, path, method="GET", body=None, **headers):
        sent = {"Host": self.host, "Cookie": self.cookie, **{k.title(): v for k, v in headers.items()}}
        line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        line.request(method, path, body, {k: v for k, v in sent.items() if v})
        answer = line.getresponse()
        answer.text = answer.read()
        line.close()
        return answer

    def live(self, origin=None, cookie=None, path="/live", **how):
        headers = {"Cookie": self.cookie if cookie is None else cookie}
        origin = f"http://{self.host}" if origin is None else origin
        return connect(
            f"ws://{self.host}{path}",
            origin=origin or None,
            additional_headers=headers,
            compression=None,
            **how,
        )


class Eye:
    """A client that takes what comes."""

    def __init__(self, socket_):
        self.socket, self.state, self.pictures, self.lines = socket_, {}, [], []

    def take(self, ack=True, timeout=10.0):
        data = self.socket.recv(timeout)
        if isinstance(data, str):
            told = json.loads(data)
            if told["part"] == "line":
                self.lines.append(told["value"])
            else:
                self.state[told["part"]] = told["value"]
            return None
        length = struct.unpack("<I", data[:4])[0]
        about = json.loads(data[4 : 4 + length])
        self.pictures.append((about, data[4 + length :]))
        if ack:
            self.send(type="ack", number=about["number"])
        return about

    def until(self, wanted, ack=True, seconds=20.0):
        end = time.monotonic() + seconds
        while not wanted():
            assert time.monotonic() < end, "it did not come"
            self.take(ack, end - time.monotonic())

    def still(self):
        self.until(lambda: self.pictures and self.pictures[-1][0]["still"])

    def send(self, **message):
        self.socket.send(json.dumps(message))
