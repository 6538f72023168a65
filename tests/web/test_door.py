"""Who gets in, who may do what, and what bad requests get."""

from __future__ import annotations

import json
import socket
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from websockets.exceptions import InvalidStatus

from tests.web.shelf_on_disk import behave
from tests.web.visitor import Visitor, job_state, news_until

GIB = 1 << 30


def test_page_opens_with_the_printed_address_and_not_without_token(shared):
    visitor = shared.visitor()
    path = shared.running.address.split(str(visitor.port), 1)[1]
    status, headers, page = Visitor(visitor.port, None).request("GET", path)
    assert status == 200
    assert b"/static/app.js" in page
    assert "Set-Cookie" not in headers
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    for wrong in ("/", "/?token=", "/?token=wrong"):
        status, _, page = Visitor(visitor.port, None).request("GET", wrong)
        assert status == 401
        assert b"app.js" not in page


@pytest.mark.parametrize("token", [None, "", "wrong", "ä" * 40])
@pytest.mark.parametrize("path", ["/api/ask", "/api/do"])
def test_requests_without_the_token_are_refused(shared, token, path):
    head = {} if token is None else {"Authorization": f"Bearer {token}".encode("latin-1").decode("latin-1")}
    status, _, body = Visitor(shared.visitor().port, None).request("POST", path, "{}", head)
    assert status == 401
    assert "token is missing or wrong" in json.loads(body)["error"]


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://localhost", "file://"]
)
def test_forged_origin_is_refused_even_with_the_token(shared, origin):
    visitor = shared.visitor()
    status, answer = visitor.post("/api/do", {"do": "stop"}, Origin=origin)
    assert status == 403
    assert origin in answer["error"]
    with pytest.raises(InvalidStatus) as refused:
        visitor.live(origin=origin)
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "192.0.2.7", "[::bad", ""])
def test_foreign_host_name_is_refused(shared, host):
    status, _, _ = shared.visitor().request("GET", "/static/app.js", headers={"Host": host})
    assert status == 403


def test_own_origin_is_welcome(shared):
    visitor = shared.visitor()
    assert visitor.post("/api/do", {"do": "stop"}, Origin=f"http://127.0.0.1:{visitor.port}")[0] == 200
    with visitor.live(origin=f"http://127.0.0.1:{visitor.port}") as wire:
        assert news_until(wire, lambda news: True)[-1]["job"] is None


def test_live_wire_needs_the_token(shared):
    with pytest.raises(InvalidStatus) as refused:
        Visitor(shared.visitor().port, "wrong").live()
    assert refused.value.response.status_code == 401


def test_read_only_link_looks_and_stops_but_changes_nothing(served, inspection):
    viewer = served.visitor("viewer")
    assert viewer.ask("overview", name="plate-1")[0] == 200
    assert viewer.ask("scene", name="plate-1", scene="surface")[0] == 200
    before = inspection.technique_file.read_bytes()
    for status, answer in (
        viewer.run("plate-1", "record"),
        viewer.do("pause"),
        viewer.ask("save", name="plate-1", changes={"plan": {"pitch_mm": 3}}),
        viewer.ask("make", new="mine", part="plate"),
        viewer.ask("duplicate", name="plate-1", new="mine"),
        viewer.ask("decide", name="plate-1", decision={"number": 1, "verdict": "accept", "name": "x"}),
    ):
        assert status == 403
        assert "read-only" in answer["error"]
    status, _, _ = viewer.request("PUT", "/api/upload?name=plate-1&file=a.ply", b"ply\n")
    assert status == 403
    assert inspection.technique_file.read_bytes() == before
    assert sorted(p.name for p in inspection.folder.parent.iterdir()) == ["plate-1"]
    behave(inspection, interval_s=0.05)
    with viewer.live() as wire:
        served.visitor().run("plate-1", "record")
        news_until(wire, lambda news: news["total"] > 2)
        wire.send(json.dumps({"do": "pause"}))
        wire.send(json.dumps({"do": "stop"}))
        assert news_until(wire, job_state("stopped"))


@pytest.mark.parametrize("name", ["..", "../plate-1", "/etc", "plate-1/..", "", None, 7, "plate-1\x00", "x" * 5000])
def test_only_listed_inspections_open(shared, name):
    status, answer = shared.visitor().ask("overview", name=name)
    assert status == 400
    assert "there is no inspection" in answer["error"]


@pytest.mark.parametrize("name", ["../out", "a/b", ".hidden", "", "x" * 65, "end.", "nul\x00", None, 3])
def test_new_inspections_get_harmless_names_only(shared, name):
    status, answer = shared.visitor().ask("make", new=name, part="plate")
    assert status == 400
    assert "no good name" in answer["error"]
    assert [p.name for p in shared.door.root.iterdir()] == ["plate-1"]


@pytest.mark.parametrize(
    "body", ["", "{", "[]", "7", '"x"', "[" * 5000, '{"ask": 3}', '{"ask": "folder"}', '{"ask": "__init__"}']
)
def test_garbage_requests_get_a_clear_answer(shared, body):
    status, answer = shared.visitor().post("/api/ask", body)
    assert status == 400
    assert "eload the page" in answer["error"]


def test_huge_request_body_is_refused(shared):
    visitor = shared.visitor()
    with socket.create_connection(("127.0.0.1", visitor.port), timeout=10) as wire:
        wire.sendall(
            f"POST /api/ask HTTP/1.1\r\nHost: 127.0.0.1:{visitor.port}\r\n"
            f"Authorization: Bearer {visitor.token}\r\nContent-Length: {2 << 20}\r\n\r\n".encode()
        )
        assert " 400 " in wire.recv(4096).decode().splitlines()[0]
    assert shared.visitor().ask("list")[0] == 200


def test_two_gigabyte_upload_is_refused_before_it_is_sent(served, inspection):
    visitor = served.visitor()
    with socket.create_connection(("127.0.0.1", visitor.port), timeout=10) as wire:
        wire.sendall(
            f"PUT /api/upload?name=plate-1&file=big.ply HTTP/1.1\r\nHost: 127.0.0.1:{visitor.port}\r\n"
            f"Authorization: Bearer {visitor.token}\r\nContent-Length: {2 * GIB}\r\n\r\n".encode()
        )
        answer = wire.recv(4096).decode()
    assert " 413 " in answer.splitlines()[0] or " 400 " in answer.splitlines()[0]
    assert not list(inspection.folder.parent.glob(".upload-*"))
    assert visitor.ask("list")[0] == 200


def test_upload_of_unknown_length_is_refused(shared):
    visitor = shared.visitor()
    with socket.create_connection(("127.0.0.1", visitor.port), timeout=10) as wire:
        wire.sendall(
            f"PUT /api/upload?name=plate-1&file=a.ply HTTP/1.1\r\nHost: 127.0.0.1:{visitor.port}\r\n"
            f"Authorization: Bearer {visitor.token}\r\nTransfer-Encoding: chunked\r\n\r\n"
            "4\r\nply\n\r\n0\r\n\r\n".encode()
        )
        assert " 411 " in wire.recv(4096).decode().splitlines()[0]


def test_broken_off_upload_leaves_nothing(served, inspection):
    visitor = served.visitor()
    with socket.create_connection(("127.0.0.1", visitor.port), timeout=10) as wire:
        wire.sendall(
            f"PUT /api/upload?name=plate-1&file=a.ply HTTP/1.1\r\nHost: 127.0.0.1:{visitor.port}\r\n"
            f"Authorization: Bearer {visitor.token}\r\nContent-Length: 1000\r\n\r\nply\n".encode()
        )
        time.sleep(0.2)
    until = time.monotonic() + 5
    while list(inspection.folder.parent.glob(".upload-*")) and time.monotonic() < until:
        time.sleep(0.05)
    assert not list(inspection.folder.parent.glob(".upload-*"))


def test_upload_is_checked_and_never_overwrites(served, inspection):
    visitor = served.visitor()
    views = inspection.step_folder("views")
    kept = (views / "view-0.ply").read_bytes()

    def put(name: str, data: bytes) -> tuple[int, dict[str, object]]:
        status, _, body = visitor.request("PUT", f"/api/upload?name=plate-1&file={name}", data)
        return status, json.loads(body)

    assert put("view-0.ply", kept) == (200, {"file": "upload-0.ply", "renamed": True})
    assert put("..%2F..%2Fescape.ply", kept)[1]["file"] == "escape.ply"
    assert put("page.html", b"<script>")[0] == 400
    status, answer = put("lie.png", b"not a picture")
    assert status == 400
    assert "is no PNG file" in str(answer["error"])
    assert put("empty.ply", b"")[0] == 413
    assert (views / "view-0.ply").read_bytes() == kept
    assert {p.name for p in views.iterdir()} == {"view-0.ply", "view-1.ply", "upload-0.ply", "escape.ply"}
    assert not (inspection.folder.parent / "escape.ply").exists()


def test_hundred_quick_clicks_on_every_button_start_one_job(served, inspection):
    behave(inspection, ticks=2000, tick_s=0.05)
    visitor = served.visitor()
    for click in (
        lambda _: visitor.run("plate-1", "surface"),
        lambda _: visitor.ask("make", new="once", part="plate"),
        lambda _: visitor.do("pause"),
        lambda _: visitor.do("stop"),
    ):
        with ThreadPoolExecutor(16) as pool:
            answers = list(pool.map(click, range(100)))
        assert {status for status, _ in answers} <= {200, 400, 409}
        assert sum(status == 200 for status, _ in answers) in (0, 1, 100)
    with visitor.live() as wire:
        last = news_until(wire, job_state("stopped"))[-1]
    assert last["job"]["number"] == 1
    assert len(visitor.ask("list")[1]["inspections"]) == 2


def test_technique_cannot_change_under_a_running_step(served, inspection):
    behave(inspection, ticks=60, tick_s=0.05)
    visitor = served.visitor()
    visitor.run("plate-1", "surface")
    status, answer = visitor.ask("save", name="plate-1", changes={"plan": {"pitch_mm": 3}})
    assert status == 409
    assert "Surface of plate-1 is under way" in answer["error"]


def test_report_opens_by_ticket_in_a_sandbox(served, inspection):
    visitor = served.visitor()
    assert "there is no report yet" in visitor.do("report", name="plate-1")[1]["error"]
    folder = inspection.step_folder("report")
    folder.mkdir()
    (folder / "report.html").write_text("<h1>report</h1>")
    address = visitor.do("report", name="plate-1")[1]["address"]
    status, headers, body = Visitor(visitor.port, None).request("GET", address)
    assert (status, body) == (200, b"<h1>report</h1>")
    assert headers["Content-Security-Policy"].startswith("sandbox allow-scripts;")
    assert Visitor(visitor.port, None).request("GET", "/file/guessed")[0] == 404


@pytest.mark.parametrize(
    "path", ["/static/../__init__.py", "/static/page.html.j2", "/static/nothing.js", "/etc/passwd", "/api"]
)
def test_other_addresses_hold_nothing(shared, path):
    assert shared.visitor().request("GET", path)[0] == 404


def test_open_to_the_network_asks_for_the_password(inspection, serve):
    served = serve(inspection.folder.parent, host="0.0.0.0", password="correct horse")
    stranger = Visitor(served.door.access.port, None)
    status, _, page = stranger.request("GET", "/")
    assert status == 401
    assert b'type="password"' in page
    assert stranger.post("/login", {"password": "wrong"})[0] == 401
    assert stranger.post("/login", {"password": 7}, Origin="http://evil.example")[0] == 403
    status, answer = stranger.post("/login", {"password": "correct horse"})
    assert status == 200
    assert Visitor(served.door.access.port, answer["token"]).ask("list")[0] == 200


def test_real_rig_of_an_inspection_does_not_move_unarmed(inspection, serve):
    inspection.rig_file.write_text('[stage]\naddress = "tcp://127.0.0.1:9"\n[instrument]\naddress = "ASRL1::INSTR"\n')
    served = serve(inspection.folder.parent, line="eddyscan.pipeline")
    visitor = served.visitor()
    assert visitor.ask("overview", name="plate-1")[1]["virtual"] is False
    with visitor.live() as wire:
        visitor.run("plate-1", "record")
        message = news_until(wire, job_state("failed"), seconds=60)[-1]["job"]["message"]
    assert "is a real rig; it moves only with --rig" in message
    assert "--arm" in message
