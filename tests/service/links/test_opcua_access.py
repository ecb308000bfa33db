"""Who is let in over OPC UA, and what stays forbidden to whom."""

from tests.service.links.opcua_plant import Client, Plant, Seen, refused, ua

# isort: split

import asyncio

from service.store.tokens import Scope
from tests.end_to_end.processes import PATIENCE_S


def test_who_is_let_in(plant: Plant) -> None:
    async def connect(user: str, secret: str) -> str:
        client = Client(plant.url, timeout=PATIENCE_S)
        client.set_user(user)
        client.set_password(secret)
        return await refused(client.connect())

    async def knock() -> None:
        assert await connect("rita", "axw_wrong") == "BadUserAccessDenied"
        assert await connect("otto", plant.secrets["rita"]) == "BadUserAccessDenied"
        brief = plant.tokens.new("brief", Scope.READ)
        async with plant.client("brief", brief) as client:
            time = client.get_node(ua.ObjectIds.Server_ServerStatus_CurrentTime)
            assert await time.read_value()
            plant.tokens.revoke("brief")
            assert await refused(time.read_value()) == "BadUserAccessDenied"

    asyncio.run(knock())


def test_nobody_writes_a_value_or_a_node(plant: Plant) -> None:
    async def attack() -> None:
        for user in (None, "otto"):
            async with plant.client(user) as client:
                index = await client.get_namespace_index("urn:axiswatch")
                node = client.get_node(ua.NodeId("demo.axis1/fm", index))
                assert await refused(node.write_value(1.0)) == "BadUserAccessDenied"
                assert await refused(node.delete()) == "BadUserAccessDenied"
                assert await refused(node.add_object(index, "mine")) == "BadUserAccessDenied"

    asyncio.run(attack())


def test_a_session_and_its_subscriptions_belong_to_their_connection(plant: Plant) -> None:
    async def attack() -> None:
        async with plant.client("otto") as victim, plant.client() as thief:
            subscription = await victim.create_subscription(100, Seen())
            number = subscription.subscription_id
            assert await refused(thief.uaclient.delete_subscriptions([number])) == "BadSubscriptionIdInvalid"
            stolen = ua.TransferSubscriptionsParameters(SubscriptionIds=[number])
            assert await refused(thief.uaclient.transfer_subscriptions(stolen)) == "BadUserAccessDenied"
            stranger = Client(plant.url, timeout=PATIENCE_S)
            await stranger.connect_sessionless()
            try:
                stranger.uaclient.protocol.authentication_token = victim.uaclient.protocol.authentication_token
                activation = ua.ActivateSessionParameters(UserIdentityToken=ua.AnonymousIdentityToken())
                assert await refused(stranger.uaclient.activate_session(activation)) == "BadSessionIdInvalid"
                node = stranger.get_node(ua.ObjectIds.Server_ServerStatus_CurrentTime)
                assert await refused(node.read_value()) == "BadUserAccessDenied"
            finally:
                await stranger.disconnect_sessionless()

    asyncio.run(attack())
