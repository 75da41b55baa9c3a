"""Reads a recording with the reference reader and says what is in it, as JSON; see tests/record.rs."""

import json
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

found = {"ticks": 0, "gaps": 0, "apex_m": [], "rewards": [], "frames": []}
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    found["attachments"] = sorted(attachment.name for attachment in reader.iter_attachments())
    last = None
    for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
        if channel.topic == "/tick":
            found["ticks"] += 1
            # A rollout begins anywhere; within it, every tick follows the one before.
            if last and decoded.policy_digest == last.policy_digest and decoded.tick != last.tick + 1:
                found["gaps"] += 1
            assert len(decoded.q_rad) == 7 and not decoded.HasField("tick_ns")
            last = decoded
        elif channel.topic == "/measures":
            measured = {measure.name: measure.value for measure in decoded.measures}
            found["apex_m"].append(measured["apex_m"])
        elif channel.topic == "/trial":
            found["rewards"].append(decoded.reward)
        elif channel.topic == "/tf":
            found["frames"] = [transform.child_frame_id for transform in decoded.transforms]
print(json.dumps(found))
