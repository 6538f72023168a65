from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eddyscan.core.errors import InputError
from eddyscan.web.access import LOCKED_S, MAX_WRONG, OPERATOR, VIEWER, Access, checked_listening
from eddyscan.web.serving import checked_rig

HOME = "127.0.0.1"
AWAY = "192.0.2.9"


def test_tokens_give_their_roles_and_nothing_else_does():
    access = Access(HOME, 8765)
    assert access.role_of(access.operator_token, HOME) == OPERATOR
    assert access.role_of(access.viewer_token, HOME) == VIEWER
    assert access.role_of(None, HOME) is None
    assert access.role_of("", HOME) is None


@given(st.text(max_size=60))
def test_no_guessed_token_opens(token):
    assert Access(HOME, 8765, operator_token="a" * 32, viewer_token="b" * 32).role_of(token, HOME) is None


def test_from_outside_the_printed_token_is_not_enough_without_the_password():
    access = Access("0.0.0.0", 8765, "correct horse")
    assert access.role_of(access.operator_token, AWAY) is None
    assert access.role_of(access.operator_token, HOME) == OPERATOR
    token = access.login("correct horse")
    assert access.role_of(token, AWAY) == OPERATOR
    assert access.role_of(access.viewer_token, AWAY) == VIEWER


def test_wrong_passwords_lock_for_a_while():
    now = [0.0]
    access = Access("0.0.0.0", 8765, "correct horse", now=lambda: now[0])
    for _ in range(MAX_WRONG):
        assert access.login("wrong") is None
    assert access.login("correct horse") is None
    now[0] += LOCKED_S + 1
    assert access.login("correct horse") is not None


def test_password_is_not_kept():
    access = Access("0.0.0.0", 8765, "correct horse")
    assert "correct horse" not in repr(vars(access))


def test_login_without_a_password_set_never_opens():
    assert Access(HOME, 8765).login("") is None


@pytest.mark.parametrize(
    ("host", "good"),
    [
        ("127.0.0.1:8765", True),
        ("localhost:8765", True),
        ("[::1]:8765", True),
        ("evil.example:8765", False),
        ("127.0.0.1.evil.example", False),
        ("192.0.2.7:8765", False),
        (None, False),
        ("", False),
        ("[::bad", False),
    ],
)
def test_host_names_on_the_loopback(host, good):
    assert Access(HOME, 8765).host_allowed(host) is good


def test_host_names_when_open_to_the_network():
    access = Access("0.0.0.0", 8765, "correct horse")
    assert access.host_allowed("192.0.2.7:8765")
    assert not access.host_allowed("evil.example:8765")


@given(st.text(max_size=40))
def test_only_our_own_origin_is_allowed(origin):
    access = Access(HOME, 8765)
    assert not access.origin_allowed(origin, "127.0.0.1:8765")
    assert access.origin_allowed("http://127.0.0.1:8765", "127.0.0.1:8765")
    assert access.origin_allowed(None, "127.0.0.1:8765")


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.7", "::", "bench.local"])
def test_listening_wider_needs_a_password(host):
    with pytest.raises(InputError, match="opens the page, and with it the rig, to the network, and no password is set"):
        checked_listening(host, None)
    with pytest.raises(InputError, match="has 5 characters, needed are 8 or more"):
        checked_listening(host, "short")
    checked_listening(host, "long enough")


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_the_loopback_needs_none(host):
    checked_listening(host, None)


def test_real_rig_needs_its_file_and_arm(tmp_path):
    rig = tmp_path / "lab.toml"
    with pytest.raises(InputError, match="there is no rig file"):
        checked_rig(rig, True)
    rig.touch()
    with pytest.raises(InputError, match="moves only with --arm given as well"):
        checked_rig(rig, False)
    with pytest.raises(InputError, match="--arm without --rig arms nothing"):
        checked_rig(None, True)
    assert checked_rig(rig, True).arm
    assert checked_rig(None, False).file is None
