"""Who may do what on the bus: a router's rules by the common name of a certificate; what no rule allows is refused.

`{own}` in a key stands for the name of the certificate's owner. Every key lies under `<root>/v1`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

from trigpoint.bus.register import Register, Registration, Role
from trigpoint.events.keys import KEY_VERSION, valid_name

ALL_MESSAGES = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "declare_liveliness_subscriber",
    "liveliness_query",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Grant:
    """Key expressions by what may be done with them.

    Who publishes or asks learns, of the keys in `hear_of`, who listens or answers; without it Zenoh sends nothing.
    """

    publish: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()
    ask: tuple[str, ...] = ()
    answer: tuple[str, ...] = ()
    claim: tuple[str, ...] = ()
    watch: tuple[str, ...] = ()
    hear_of: tuple[str, ...] = ()
    everything: tuple[str, ...] = ()

    def joined(self, *others: "Grant") -> "Grant":
        """What this one or another allows."""
        return Grant(
            **{
                field.name: tuple(dict.fromkeys(key for one in (self, *others) for key in getattr(one, field.name)))
                for field in fields(Grant)
            }
        )


CLIENT = Grant(listen=("map/**",), ask=("map/**",), watch=("live/**",), hear_of=("map/**",))
INGEST = Grant(
    publish=(
        "veh/*/obs/**",
        "ack/*",
        "refused",
        "map/*/frame",
        "map/*/anchor",
        "map/*/anchor-retraction",
        "map/*/drive-exclusion",
        "map/*/drive-inclusion",
    ),
    listen=("veh/*/up/**",),
    claim=("live/ingest/**", "live/ingest-of-all/**"),
    watch=("live/**",),
    hear_of=("**",),
)
FILTERING = Grant(
    publish=("veh/*/est/**",),
    listen=("veh/*/obs/**", "map/**"),
    claim=("live/filtering/**",),
    watch=("live/**",),
    hear_of=("**",),
)
PERCEPTION = Grant(
    publish=("veh/*/perc/**",),
    listen=("veh/*/obs/**", "map/**"),
    claim=("live/perception/**",),
    watch=("live/**",),
    hear_of=("**",),
)
OPTIMISATION = Grant(
    publish=(
        "map/*/trajectory/*",
        "map/*/lm/**",
        "map/*/association",
        "map/*/image-offset",
        "map/*/label-gain",
        "map/*/version",
        "veh/*/corr/**",
    ),
    listen=("veh/*/obs/**", "veh/*/est/**", "veh/*/perc/**", "map/**"),
    claim=("live/optimisation/**",),
    watch=("live/**",),
    hear_of=("**",),
)
LANDMARKS = Grant(
    publish=("map/*/changes/**",),
    listen=("map/**", "veh/*/obs/landmarks"),
    claim=("live/landmarks/**",),
    watch=("live/**",),
    hear_of=("**",),
)
ANSWERS = Grant(
    listen=("map/**", "veh/*/obs/landmarks"),
    answer=("map/*/ask/**",),
    claim=("live/answers/**",),
    watch=("live/**",),
    hear_of=("**",),
)

GRANTS: Mapping[Role, Grant] = {
    Role.VEHICLE: CLIENT.joined(
        Grant(
            publish=("veh/{own}/up/**",),
            listen=("ack/{own}", "veh/{own}/corr/**"),
            claim=("live/vehicle/{own}/**",),
            hear_of=("veh/*/up/**",),
        )
    ),
    Role.CLIENT: CLIENT,
    Role.INGEST: INGEST,
    Role.FILTERING: FILTERING,
    Role.PERCEPTION: PERCEPTION,
    Role.OPTIMISATION: OPTIMISATION,
    Role.LANDMARKS: LANDMARKS,
    Role.ANSWERS: ANSWERS,
    Role.HTTP: CLIENT,
    Role.SERVICE: INGEST.joined(FILTERING, PERCEPTION, OPTIMISATION, LANDMARKS, ANSWERS),
    Role.ROUTER: Grant(everything=("**",)),
}

# What each field of a Grant lets in from its owner, and lets out to it.
LET_IN: Mapping[str, tuple[str, ...]] = {
    "publish": ("put",),
    "listen": ("declare_subscriber",),
    "ask": ("query",),
    "answer": ("declare_queryable", "reply"),
    "claim": ("liveliness_token",),
    "watch": ("declare_liveliness_subscriber", "liveliness_query"),
    "hear_of": (),
    "everything": ALL_MESSAGES,
}
LET_OUT: Mapping[str, tuple[str, ...]] = {
    "publish": (),
    "listen": ("put", "delete"),
    "ask": ("reply",),
    "answer": ("query",),
    "claim": (),
    "watch": ("liveliness_token",),
    "hear_of": ("declare_subscriber", "declare_queryable"),
    "everything": ALL_MESSAGES,
}


def access_control(register: Register, *, root: str) -> dict[str, Any]:
    """Zenoh's `access_control`: the rules of everyone in force, and default deny for everyone else."""
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    owners = register.in_force()
    for owner in owners:
        own = list(_rules(owner, f"{valid_name(root)}/{KEY_VERSION}"))
        rules += own
        policies.append({"rules": [rule["id"] for rule in own], "subjects": [owner.common_name]})
    subjects = [{"id": owner.common_name, "cert_common_names": [owner.common_name]} for owner in owners]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rules(owner: Registration, prefix: str) -> Iterable[dict[str, Any]]:
    """A rule for each kind of thing an owner may do, in and out."""
    grant = GRANTS[owner.role]
    for field in fields(Grant):
        keys = [f"{prefix}/{key.replace('{own}', owner.name)}" for key in getattr(grant, field.name)]
        for flow, messages in (("ingress", LET_IN[field.name]), ("egress", LET_OUT[field.name])):
            if keys and messages:
                yield {
                    "id": f"{owner.common_name} {field.name} {flow}",
                    "permission": "allow",
                    "flows": [flow],
                    "messages": list(messages),
                    "key_exprs": keys,
                }
