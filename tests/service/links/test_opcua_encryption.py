"""OPC UA with a certificate: nothing goes in the clear, and one that cannot be used is named."""

from tests.service.links.opcua_plant import Client, Plant, linked, refused, ua

# isort: split

import asyncio
import re
import shlex
import subprocess
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from asyncua.crypto.uacrypto import CertProperties

from service.config.schema import LinksConfig
from service.links.link_secrets import LinkSecretError
from service.links.opcua_access import identity
from service.store.tokens import Scope
from tests.conftest import ROOT
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.ports import own_port

TEXT = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8")
OPENSSL = re.findall(r"^(openssl req .*?[^\\])$", TEXT, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory, need: Callable[[str], str]) -> Path:
    """A folder with what the command of docs/operation.md makes."""
    folder = tmp_path_factory.mktemp("certificates")
    (command,) = OPENSSL
    words = [need("openssl"), *shlex.split(command.replace("\\\n", " "))[1:]]
    subprocess.run(words, cwd=folder, check=True, capture_output=True, timeout=PATIENCE_S)
    return folder


def test_with_a_certificate_everything_is_encrypted(certificates: Path, tmp_path: Path) -> None:
    files = {"certificate": str(certificates / "opcua.crt"), "key": str(certificates / "opcua.key")}
    with ExitStack() as stack:
        plant = linked(stack, tmp_path, own_port(), **files)
        assert plant.links.snapshots()[0].problem.startswith("no client has access: there is no token")
        plant.secrets["otto"] = plant.tokens.new("otto", Scope.OPERATE)
        wait_for(lambda: not plant.links.snapshots()[0].problem)
        asyncio.run(encrypted(plant, files))


async def encrypted(plant: Plant, files: dict[str, str]) -> None:
    plain = Client(plant.url, timeout=PATIENCE_S)
    endpoints = await plain.connect_and_get_server_endpoints()
    assert {e.SecurityMode for e in endpoints} == {ua.MessageSecurityMode.SignAndEncrypt}
    assert {e.Server.ApplicationUri for e in endpoints} == {"urn:axiswatch.plant.example"}
    tokens = {t.TokenType for e in endpoints for t in e.UserIdentityTokens}
    assert tokens == {ua.UserTokenType.UserName}
    # A client that does not care about the end points gets a session that is good for nothing.
    await plain.connect_sessionless()
    try:
        with pytest.raises(ua.UaError, match="No matching endpoints"):
            await plain.create_session()
        login = ua.UserNameIdentityToken(PolicyId="username", UserName="otto", Password=plant.secrets["otto"].encode())
        await plain.uaclient.activate_session(ua.ActivateSessionParameters(UserIdentityToken=login))
        node = plain.get_node(ua.ObjectIds.Server_ServerStatus_CurrentTime)
        assert await refused(node.read_value()) == "BadUserAccessDenied"
    finally:
        await plain.disconnect_sessionless()
    client = Client(plant.url, timeout=PATIENCE_S)
    client.application_uri = "urn:axiswatch.plant.example"
    await client.set_security(SecurityPolicyBasic256Sha256, *(_pem(files[n]) for n in ("certificate", "key")))
    client.set_user("otto")
    client.set_password(plant.secrets["otto"])
    async with client:
        index = await client.get_namespace_index("urn:axiswatch")
        assert await client.get_node(ua.NodeId("demo.axis1/fm", index)).read_value() == 0.07832


def _pem(path: str) -> CertProperties:
    return CertProperties(Path(path), "pem")


def test_a_certificate_that_cannot_be_used_is_named(certificates: Path) -> None:
    tls = ROOT / "tests" / "tls"

    def problem(certificate: Path, key: Path) -> str:
        config = LinksConfig.model_validate({"opcua": {"certificate": str(certificate), "key": str(key)}})
        assert config.opcua is not None
        with pytest.raises(LinkSecretError) as caught:
            identity(config.opcua)
        return str(caught.value)

    right = certificates / "opcua.crt"
    assert "OPC UA needs an RSA key" in problem(tls / "localhost.crt", tls / "localhost.key")
    assert "the key is that of another certificate" in problem(tls / "localhost.crt", certificates / "opcua.key")
    assert "no PEM certificate" in problem(right, tls / "encrypted.key")
    assert problem(right, certificates / "none.key") == f"{certificates / 'none.key'}: No such file or directory"
