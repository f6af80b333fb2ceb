"""Identities of pages: a public name, and a secret that only the page itself and the server know.

A page gets both when it connects, and shows the secret to be the same page again after a reload or a lost line. The secret
is another one after every connection: the one before ends as soon as the page says that it has the new one, so that a copy
of it is worth nothing. A name alone is worth nothing either.
"""

from __future__ import annotations

import hashlib
import secrets
from collections import OrderedDict
from dataclasses import dataclass

KEPT = 256  # identities that are remembered; the one that connected longest ago is forgotten first


@dataclass
class Identity:
    """Identity of one page.

    Attributes:
        name: public.
        digest: digest of the secret that the page is known to have; empty before it said so.
        next_digest: digest of the secret that it was given last; empty once the page has confirmed it.
    """

    name: str
    digest: bytes = b""
    next_digest: bytes = b""


class PageRegistry:
    """Identities of all pages of a server; for one thread."""

    def __init__(self) -> None:
        self._identities: OrderedDict[str, Identity] = OrderedDict()
        self._names: dict[bytes, str] = {}  # by the digest of a secret that is valid

    def admit(self, secret: str) -> tuple[str, str]:
        """Identity of a secret, or a new one if the secret is not valid.

        Returns:
            Its public name, and the secret that it shows next time.
        """
        digest = _digest(secret)
        identity = self._identities.get(self._names.get(digest, ""))
        if identity is None:
            identity = Identity(secrets.token_hex(6))
            self._identities[identity.name] = identity
        elif digest == identity.next_digest:
            self.confirm(identity.name)  # the page has it, whether it said so or not
        self._names.pop(identity.next_digest, None)
        fresh = secrets.token_urlsafe(24)
        identity.next_digest = _digest(fresh)
        self._names[identity.next_digest] = identity.name
        self._identities.move_to_end(identity.name)
        while len(self._identities) > KEPT:
            _, oldest = self._identities.popitem(last=False)
            self._names.pop(oldest.digest, None)
            self._names.pop(oldest.next_digest, None)
        return identity.name, fresh

    def confirm(self, name: str) -> None:
        """Confirm that the page has its new secret, which invalidates the previous one."""
        identity = self._identities.get(name)
        if identity is not None and identity.next_digest:
            self._names.pop(identity.digest, None)
            identity.digest, identity.next_digest = identity.next_digest, b""


def _digest(secret: str) -> bytes:
    """Digest of a secret, compared in its place so that the time of a comparison reveals nothing."""
    return hashlib.sha256(secret.encode("utf-8", "replace")).digest()
