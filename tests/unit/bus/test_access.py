"""The rules of a router: what each role may do, against the table of the way of the data."""

from typing import Any

import pytest

from trigpoint.bus.access import GRANTS, Grant, access_control
from trigpoint.bus.key_expressions import key_matches
from trigpoint.bus.register import Register, Registration, Role
from trigpoint.dataflow import FLOWS, Flow
from trigpoint.events.uplink import acknowledgement_key, claim_expressions, claim_key, uplink_key

ROOT = "fleet"
ON_THE_BUS = {
    "trigpoint_ingest": Role.INGEST,
    "trigpoint_filtering": Role.FILTERING,
    "trigpoint_perception": Role.PERCEPTION,
    "trigpoint_optimisation": Role.OPTIMISATION,
    "trigpoint_landmarks": Role.LANDMARKS,
    "trigpoint_vehicle": Role.VEHICLE,
}  # evaluation reads the log only
CHUNKS = {"vehicle": "veh-a", "map": "main", "zoom": 16, "column": 1, "row": 2}


def row(name: str, role: Role, *, common_name: str = "", revoked: bool = False) -> Registration:
    return Registration(
        name=name, common_name=common_name or name, role=role, serial="1", not_after_s=2_000_000_000, revoked=revoked
    )


def allowed(role: Role, kind: str, key: str, *, name: str = "veh-a") -> bool:
    """Whether a role's grant allows something with a key below `<root>/v1`."""
    return any(key_matches(expression.replace("{own}", name), key) for expression in getattr(GRANTS[role], kind))


def key_below_root(flow: Flow) -> str:
    return flow.key.removeprefix("{root}/v1/").format(**CHUNKS)


@pytest.mark.parametrize("flow", FLOWS, ids=lambda flow: flow.name)
def test_the_writer_of_an_event_may_publish_it_and_its_readers_may_listen(flow: Flow) -> None:
    readers = [ON_THE_BUS[reader] for reader in flow.readers if reader in ON_THE_BUS]
    key = key_below_root(flow)
    assert allowed(ON_THE_BUS[flow.writer], "publish", key)
    assert [role for role in readers if not allowed(role, "listen", key)] == []


@pytest.mark.parametrize("flow", FLOWS, ids=lambda flow: flow.name)
def test_nobody_else_may_publish_an_event(flow: Flow) -> None:
    able = {role for role in GRANTS if allowed(role, "publish", key_below_root(flow))}
    assert able == {ON_THE_BUS[flow.writer], Role.SERVICE}


def test_a_vehicle_sends_and_is_acknowledged_under_its_own_name_only() -> None:
    own, other = (uplink_key(name, None, root=ROOT).removeprefix(f"{ROOT}/v1/") for name in ("veh-a", "veh-b"))
    heard = [acknowledgement_key(name, root=ROOT).removeprefix(f"{ROOT}/v1/") for name in ("veh-a", "veh-b")]
    assert [allowed(Role.VEHICLE, "publish", key) for key in (own, other)] == [True, False]
    assert [allowed(Role.VEHICLE, "listen", key) for key in heard] == [True, False]


@pytest.mark.parametrize("vehicle", ["veh-a", None])
def test_ingest_may_claim_its_vehicles_and_see_who_else_does(vehicle: str | None) -> None:
    claim = claim_key(vehicle, "1", root=ROOT).removeprefix(f"{ROOT}/v1/")
    looks = [one.removeprefix(f"{ROOT}/v1/") for one in claim_expressions(root=ROOT)]
    assert allowed(Role.INGEST, "claim", claim)
    assert all(look.startswith("live/") for look in looks)
    assert GRANTS[Role.INGEST].watch == ("live/**",)
    assert not allowed(Role.VEHICLE, "claim", claim)


def test_what_a_vehicle_reads_beside_its_own_is_what_a_client_reads() -> None:
    vehicle, client = GRANTS[Role.VEHICLE], GRANTS[Role.CLIENT]
    assert [key for key in vehicle.listen if "{own}" not in key] == list(client.listen)
    assert client.publish == ()


def test_the_role_of_all_services_is_all_of_them_together() -> None:
    all_of_them = (Role.INGEST, Role.FILTERING, Role.PERCEPTION, Role.OPTIMISATION, Role.LANDMARKS, Role.ANSWERS)
    single = [GRANTS[role] for role in all_of_them]
    assert GRANTS[Role.SERVICE] == Grant().joined(*single)


def test_rules_name_the_certificate_and_deny_what_is_not_named() -> None:
    rules = access_control(Register((row("veh-a", Role.VEHICLE),)), root=ROOT)
    assert rules["default_permission"] == "deny"
    assert rules["subjects"] == [{"id": "veh-a", "cert_common_names": ["veh-a"]}]
    assert key_expressions(rules, "veh-a publish ingress") == ["fleet/v1/veh/veh-a/up/**"]


def test_a_revoked_certificate_has_no_rule_and_the_next_one_of_its_name_has_the_same_keys() -> None:
    rows = (row("veh-a", Role.VEHICLE, revoked=True), row("veh-a", Role.VEHICLE, common_name="veh-a.2"))
    rules = access_control(Register(rows), root=ROOT)
    assert [subject["id"] for subject in rules["subjects"]] == ["veh-a.2"]
    assert key_expressions(rules, "veh-a.2 publish ingress") == ["fleet/v1/veh/veh-a/up/**"]


def key_expressions(rules: dict[str, Any], name: str) -> list[str]:
    (found,) = [rule["key_exprs"] for rule in rules["rules"] if rule["id"] == name]
    assert isinstance(found, list)
    return found
