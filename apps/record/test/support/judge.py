"""Reads a recording with Python's mcap, all checksums checked, and prints what it has, a line each."""
import json
import sys

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, validate_crcs=True)
    summary = reader.get_summary()
    statistics = summary.statistics
    print("count", statistics.message_count, "chunks", len(summary.chunk_indexes),
          "from", statistics.message_start_time, "to", statistics.message_end_time)
    for id, channel in sorted(summary.channels.items()):
        schema = summary.schemas.get(channel.schema_id)
        if schema:
            json.loads(schema.data)
        print("channel", id, channel.topic, channel.message_encoding, schema.name if schema else "-",
              statistics.channel_message_counts[id], json.dumps(channel.metadata, sort_keys=True))
    for note in reader.iter_metadata():
        print("note", note.name, json.dumps(note.metadata, sort_keys=True))
    for schema, channel, message in reader.iter_messages():
        if channel.message_encoding == "json":
            json.loads(message.data)
        print("message", channel.topic, message.sequence, message.log_time, message.data.hex())
    window = [int(ns) for ns in sys.argv[2:4]]
    print("window", sum(1 for _ in reader.iter_messages(start_time=window[0], end_time=window[1])))

# Once more from begin to end: this judges the checksum of all the data, too.
with open(sys.argv[1], "rb") as file:
    records = list(StreamReader(file, validate_crcs=True).records)
    print("records", records[-1].__class__.__name__)
