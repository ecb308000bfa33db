"""Access to the OPC UA server, whose users are the tokens of the API; and the server's certificate.

asyncua trusts clients too much: a client that guesses the number of a session can join it, and can change subscriptions
of others.  Here a session belongs to its connection, and a subscription to its session.
"""

import socket
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import structlog
from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import USER_TYPES, PermissionRuleset, User, UserRole
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession
from asyncua.server.standard_address_space import standard_address_space
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey

from monitor_core.wording import sentence
from service.config.schema import OpcUaConfig
from service.links.link_secrets import LinkSecretError
from service.store.database import StoreError
from service.store.tokens import Caller, Scope, TokenFile

ANONYMOUS = "anonymous"
MOST_CONNECTIONS, MOST_SUBSCRIPTIONS = 50, 200
_CHANGING = (
    ua.ObjectIds.WriteRequest_Encoding_DefaultBinary,
    ua.ObjectIds.HistoryReadRequest_Encoding_DefaultBinary,
    ua.ObjectIds.TransferSubscriptionsRequest_Encoding_DefaultBinary,
)
"""Requests that nobody may make: writing values, reading history, taking over a subscription of another client."""
_ALLOWED = frozenset(ua.NodeId(kind) for kind in USER_TYPES if kind not in _CHANGING)
_REFRESH = frozenset(
    ua.NodeId(method)
    for method in (ua.ObjectIds.ConditionType_ConditionRefresh, ua.ObjectIds.ConditionType_ConditionRefresh2)
)
_OLD_PADDING = "http://www.w3.org/2001/04/xmlenc#rsa-1_5"

log = structlog.get_logger(__name__)

Method = Callable[[str, ua.CallMethodRequest], Awaitable[ua.CallMethodResult | None]]
"""Handles a method call of a user with the scope operate; returns None if there is no such method."""


@dataclass
class OpcuaUser(User):
    """A user with access.  The secret is checked at each request, so that a revoked token has effect."""

    role: UserRole = UserRole.User
    secret: str | None = field(default=None, repr=False)


class Users(PermissionRuleset):
    """Users by the tokens of the API: the name of a token with its secret as password.

    ``anonymous``: whether a client without name and password may read.
    """

    def __init__(self, tokens: TokenFile, anonymous: bool) -> None:
        self._tokens, self._anonymous = tokens, anonymous

    @property
    def problem(self) -> str:
        """Why no client has access; empty: some may have."""
        try:
            known = self._anonymous or self._tokens.tokens()
        except StoreError as error:
            return str(error)
        words = "no client has access: there is no token (axiswatch token new NAME --scope read)"
        return "" if known else sentence("nobody let in", words)

    def get_user(
        self,
        iserver: InternalServer,  # noqa: ARG002
        username: str | None = None,
        password: str | None = None,
        certificate: object = None,  # noqa: ARG002
    ) -> OpcuaUser | None:
        """The user of a session; None: it is refused."""
        user = OpcuaUser(name=ANONYMOUS if username is None else username, secret=password)
        if self.may(user, Scope.READ):
            return user
        log.info("a client of the OPC UA server is refused", user=str(user.name)[:64])
        return None

    def may(self, user: User, scope: Scope) -> bool:
        """Whether a user has this scope now."""
        if not isinstance(user, OpcuaUser):  # not logged in yet
            return False
        if user.secret is None:
            return self._anonymous and user.name == ANONYMOUS and scope is Scope.READ
        caller = self._caller(user.secret)
        return caller is not None and caller.name == user.name and scope in caller.scopes

    def _caller(self, secret: str) -> Caller | None:
        try:
            return self._tokens.caller(secret)
        except StoreError:  # shown as the problem of the link
            return None

    def check_validity(self, user: User, action_type: ua.NodeId, body: object) -> bool:  # noqa: ARG002
        """Whether a user may make a request of this kind."""
        return action_type in _ALLOWED and self.may(user, Scope.READ)


class Nobody(PermissionRuleset):
    """Rules for unencrypted connections, if encryption is needed: without rules, asyncua would allow everything."""

    def check_validity(self, user: User, action_type: ua.NodeId, body: object) -> bool:  # noqa: ARG002
        """Always False: on such a connection, a client can only ask how to connect, which needs no session."""
        return False


class GuardedServer(InternalServer):
    """The server behind the connections, with limits, and with sessions that no other client can join."""

    def __init__(self, users: Users, operate: Method) -> None:
        super().__init__(user_manager=users)  # duck typing: it need not be a UserManager
        self.users, self.operate = users, operate
        self.max_connections, self.max_subscriptions = MOST_CONNECTIONS, MOST_SUBSCRIPTIONS

    async def load_standard_address_space(self, shelf_file: object = None) -> None:  # noqa: ARG002
        """Make the nodes of the standard in this thread, as another thread could not be ended when the daemon stops."""
        standard_address_space.fill_address_space(self.node_mgt_service)

    def create_session(self, name: str, user: User | None = None, external: bool = False) -> InternalSession:
        """Make the session of a connection, whose user is not known yet."""
        who = user or User(role=UserRole.Anonymous)
        return _Session(self, self.aspace, self.subscription_service, name, user=who, external=external)

    def lookup_external_session(self, auth_token: ua.NodeId) -> None:  # noqa: ARG002
        """Always None: asyncua numbers sessions in order, and would let a client join one before it has logged in."""
        return

    def register_server(self, server: object, conf: object = None) -> None:  # noqa: ARG002
        """Refuse, as this is no discovery server.

        Raises:
            ServiceError: always.
        """
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)

    def decrypt_user_token(self, isession: Any, token: ua.UserNameIdentityToken) -> tuple[str, str]:
        """Decrypt name and password of a user.

        Raises:
            ServiceError: the padding of the encrypted password is insecure.
        """
        if token.EncryptionAlgorithm == _OLD_PADDING:
            raise ServiceError(ua.StatusCodes.BadIdentityTokenInvalid)
        return super().decrypt_user_token(isession, token)


class _Session(InternalSession):
    """A session that can change only its own subscriptions, and calls methods with the rights of its user."""

    iserver: GuardedServer

    def _check_own(self, number: int) -> None:
        subscription = self.subscription_service.subscriptions.get(number)
        if subscription is None or subscription.session_id != self.session_id:
            raise ServiceError(ua.StatusCodes.BadSubscriptionIdInvalid)

    async def call(self, params: list[ua.CallMethodRequest]) -> list[ua.CallMethodResult]:
        return [await self._called(method) for method in params]

    async def _called(self, method: ua.CallMethodRequest) -> ua.CallMethodResult:
        if method.MethodId in _REFRESH:
            arguments = method.InputArguments or []
            self._check_own(arguments[0].Value if arguments else 0)
            (result,) = await super().call([method])
            return result
        if not self.iserver.users.may(self.user, Scope.OPERATE):
            return ua.CallMethodResult(StatusCode=ua.StatusCode(ua.StatusCodes.BadUserAccessDenied))
        done = await self.iserver.operate(str(self.user.name), method)
        if done is None:
            (done,) = await super().call([method])
        return done

    async def delete_subscriptions(self, ids: list[int]) -> list[ua.StatusCode]:
        for number in ids:
            self._check_own(number)
        return await super().delete_subscriptions(ids)

    async def create_monitored_items(
        self, params: ua.CreateMonitoredItemsParameters
    ) -> list[ua.MonitoredItemCreateResult]:
        self._check_own(params.SubscriptionId)
        return await super().create_monitored_items(params)

    async def modify_monitored_items(
        self, params: ua.ModifyMonitoredItemsParameters
    ) -> list[ua.MonitoredItemModifyResult]:
        self._check_own(params.SubscriptionId)
        return await super().modify_monitored_items(params)

    async def delete_monitored_items(self, params: ua.DeleteMonitoredItemsParameters) -> list[ua.StatusCode]:
        self._check_own(params.SubscriptionId)
        return await super().delete_monitored_items(params)

    async def set_monitoring_mode(self, params: ua.SetMonitoringModeParameters) -> list[ua.StatusCode]:
        self._check_own(params.SubscriptionId)
        return await super().set_monitoring_mode(params)

    async def set_publishing_mode(self, params: ua.SetPublishingModeParameters) -> list[ua.StatusCode]:
        for number in params.SubscriptionIds:
            self._check_own(number)
        return await super().set_publishing_mode(params)

    def republish(self, params: ua.RepublishParameters) -> ua.NotificationMessage:
        self._check_own(params.SubscriptionId)
        return super().republish(params)


class Identity(NamedTuple):
    """Application URI and certificate of the server."""

    uri: str
    """URI of the application; equal to that in the certificate, as clients compare them"""
    certificate: bytes = b""
    """PEM; empty: connections are neither signed nor encrypted"""
    key: bytes = b""


def identity(config: OpcUaConfig) -> Identity:
    """The identity of a configuration.

    Raises:
        LinkSecretError: the certificate or the key cannot be used.
    """
    if config.certificate is None or config.key is None:
        return Identity(f"urn:{socket.gethostname()}:axiswatch")
    texts = []
    for path in (config.certificate, config.key):
        try:
            texts.append(path.read_bytes())
        except OSError as error:
            raise LinkSecretError(f"{path}: {error.strerror}") from None
    place = f"{config.certificate} and {config.key}"
    try:
        certificate = x509.load_pem_x509_certificate(texts[0])
        key = serialization.load_pem_private_key(texts[1], password=None)
    except (ValueError, TypeError) as error:
        raise LinkSecretError(f"{place}: no PEM certificate with a private key without a password ({error})") from None
    if not isinstance(key, RSAPrivateKey):
        raise LinkSecretError(f"{config.key}: OPC UA needs an RSA key, of 2048 bits or more")
    if key.public_key() != certificate.public_key():
        raise LinkSecretError(f"{place}: the key is that of another certificate")
    return Identity(_uri(certificate) or f"urn:{socket.gethostname()}:axiswatch", *texts)


def _uri(certificate: x509.Certificate) -> str:
    """The URI in a certificate; empty: it has none, so that some clients refuse it."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ""
    return next(iter(names.get_values_for_type(x509.UniformResourceIdentifier)), "")
