"""Bodies that views show, and messages of files of Foxglove."""

from orchestrator.log.reader import Log
from orchestrator.results.run_data import RunData
from orchestrator.results.views.bodies import Bodies


def bodies_of(driven):
    """Open log of the vehicle, its bodies and their poses at every record."""
    with Log(driven) as log:
        bodies = Bodies(RunData(log), 1e4)
        yield log, bodies, next(bodies.blocks())


def decoded(path, topic):
    """Messages of a topic, decoded by the schema in the file."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from mcap.reader import make_reader

    messages = []
    with path.open("rb") as file:
        for schema, _, message in make_reader(file).iter_messages(topic):
            pool = descriptor_pool.DescriptorPool()
            for each in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                pool.Add(each)
            kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            messages.append(kind.FromString(message.data))
    return messages
