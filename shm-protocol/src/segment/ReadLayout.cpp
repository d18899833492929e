// Validates an untrusted header; the error names the offending field.
#include <bit>
#include <cmath>
#include <cstring>

#include "SegmentLayout.h"
#include "shm-protocol/src/wait/Atomics.h"
#include "shm_protocol/Array.h"
#include "shm_protocol/Error.h"

namespace shm_protocol {
namespace {

class LayoutChecker {
 public:
  explicit LayoutChecker(const std::string& origin) : origin_(origin) {}

  void operator()(bool valid, const std::string& field) const {
    if (!valid) throw Error(ErrorCode::kCorrupt, origin_ + ": corrupt header: " + field);
  }

 private:
  const std::string& origin_;
};

// Returns whether `count` items of `size` bytes at `offset` lie within `total` bytes, without overflow.
bool fits(std::uint64_t offset, std::uint64_t count, std::uint64_t size, std::uint64_t total) {
  return offset <= total && (size == 0 || count <= (total - offset) / size);
}

template <std::size_t N>
bool is_text(const char (&field)[N], bool may_be_empty) {
  return std::memchr(field, '\0', N) != nullptr && (may_be_empty || field[0] != '\0');
}

void check_identity(const ssp_identity& id, std::uint64_t mapped_bytes, const LayoutChecker& check) {
  check(id.header_bytes >= sizeof(ssp_header) && id.header_bytes <= mapped_bytes, "header_bytes");
  check(id.segment_bytes >= id.header_bytes && id.segment_bytes <= mapped_bytes,
        "segment_bytes = " + std::to_string(id.segment_bytes) + ", but the segment has " +
            std::to_string(mapped_bytes));
  check(id.surface_process != 0, "surface_process");
  check(id.session != 0, "session");
  check(id.dt_ns != 0, "dt_ns");
  check(id.mode == SSP_MODE_TIME_STEP || id.mode == SSP_MODE_PASSIVE, "mode");
  check(is_text(id.name, false), "name");
}

// A ring follows the header, is line-aligned, and its slots are large enough for the slot header.
void check_ring(std::uint64_t offset, std::uint64_t slots, std::uint64_t slot_bytes, const ssp_identity& id,
                const LayoutChecker& check, const std::string& which) {
  check(std::has_single_bit(slots) && slots >= SSP_MIN_SLOTS && slots <= SSP_MAX_SLOTS, which + "_slots");
  check(slot_bytes % SSP_LINE == 0 && slot_bytes >= sizeof(ssp_slot), which + "_slot_bytes");
  check(offset % SSP_LINE == 0 && offset >= id.header_bytes &&
            fits(offset, slots, slot_bytes, id.segment_bytes),
        which + "_ring_offset");
}

void check_geometry(const ssp_geometry& g, const ssp_identity& id, const LayoutChecker& check) {
  check(g.rows >= 1 && g.rows <= 65536, "rows");
  check(g.columns >= 1 && g.columns <= 65536, "columns");
  check(std::isfinite(g.pitch) && g.pitch > 0.0, "pitch");
  check(g.channel_count >= 1 && g.channel_count <= SSP_MAX_CHANNELS, "channel_count");
  check(g.channel_bytes >= sizeof(ssp_channel) && g.channel_bytes <= 4096 && g.channel_bytes % 8 == 0,
        "channel_bytes");
  check(g.channels_offset >= id.header_bytes && g.channels_offset % 8 == 0 &&
            fits(g.channels_offset, g.channel_count, g.channel_bytes, id.segment_bytes),
        "channels_offset");
  check(g.slot_header_bytes == sizeof(ssp_slot), "slot_header_bytes");
  check_ring(g.sensor_ring_offset, g.sensor_slots, g.sensor_slot_bytes, id, check, "sensor");
  check_ring(g.actuator_ring_offset, g.actuator_slots, g.actuator_slot_bytes, id, check, "actuator");
  const std::uint64_t sensors_end = g.sensor_ring_offset + g.sensor_slots * g.sensor_slot_bytes;
  const std::uint64_t actuators_end = g.actuator_ring_offset + g.actuator_slots * g.actuator_slot_bytes;
  check(sensors_end <= g.actuator_ring_offset || actuators_end <= g.sensor_ring_offset, "the rings overlap");
  if (g.positions_offset == 0) return;
  check(g.position_components == 3, "position_components");
  check(g.positions_offset >= id.header_bytes && g.positions_offset % 4 == 0 &&
            fits(g.positions_offset, std::uint64_t{g.rows} * g.columns, sizeof(float[3]), id.segment_bytes),
        "positions_offset");
}

void check_channel(const ssp_channel& c, std::size_t number, const ssp_geometry& g,
                   const LayoutChecker& check) {
  const std::string where = "channel " + std::to_string(number) + ": ";
  check(is_text(c.name, false), where + "name");
  check(is_text(c.unit, true), where + "unit");
  check(c.direction == SSP_SENSOR || c.direction == SSP_ACTUATOR, where + "direction");
  check(c.dtype == SSP_F32 || c.dtype == SSP_U32 || c.dtype == SSP_U8, where + "dtype");
  check(c.components >= 1 && c.components <= 64, where + "components");
  const auto dtype = static_cast<DType>(c.dtype);
  const auto [lowest, highest] = dtype_limits(dtype);
  // Written so that a NaN fails.
  check(c.minimum >= lowest && c.minimum <= c.maximum && c.maximum <= highest, where + "range");
  check(c.safe >= c.minimum && c.safe <= c.maximum, where + "safe");
  const std::uint64_t slot_bytes = c.direction == SSP_SENSOR ? g.sensor_slot_bytes : g.actuator_slot_bytes;
  check(c.bytes == std::uint64_t{g.rows} * g.columns * c.components * element_bytes(dtype), where + "bytes");
  check(c.offset >= sizeof(ssp_slot) && c.offset % SSP_ARRAY_ALIGNMENT == 0 &&
            fits(c.offset, 1, c.bytes, slot_bytes),
        where + "offset");
}

void check_overlaps(const std::vector<ssp_channel>& channels, const LayoutChecker& check) {
  for (std::size_t a = 0; a < channels.size(); ++a)
    for (std::size_t b = 0; b < a; ++b) {
      const auto &x = channels[a], &y = channels[b];
      const bool disjoint =
          x.direction != y.direction || x.offset + x.bytes <= y.offset || y.offset + y.bytes <= x.offset;
      check(disjoint, "channels " + std::to_string(b) + " and " + std::to_string(a) + " overlap");
    }
}

void check_version(std::uint32_t version, const std::string& origin) {
  if (version >> 16 == SSP_VERSION_MAJOR) return;
  throw Error(ErrorCode::kWrongVersion,
              origin + ": the surface speaks protocol version " + std::to_string(version >> 16) + "." +
                  std::to_string(version & 0xFFFF) + ", this program " + std::to_string(SSP_VERSION_MAJOR) +
                  "." + std::to_string(SSP_VERSION_MINOR) + "; the major versions must be equal");
}

}  // namespace

std::optional<SegmentLayout> read_layout(std::span<const std::byte> segment, const std::string& origin) {
  const LayoutChecker check(origin);
  if (segment.size() < sizeof(ssp_identity))
    throw Error(ErrorCode::kCorrupt, origin + ": truncated: " + std::to_string(segment.size()) + " bytes");
  const auto& shared = *reinterpret_cast<const ssp_header*>(segment.data());
  if (load_relaxed(shared.identity.magic) != SSP_MAGIC)
    throw Error(ErrorCode::kForeign, origin + ": not a surface's segment (no SMRTSURF at its beginning)");
  const std::uint32_t version = load_acquire(shared.identity.version);
  if (version == 0) return std::nullopt;
  check_version(version, origin);
  check(segment.size() >= sizeof(ssp_header), "truncated: " + std::to_string(segment.size()) + " bytes");

  // Copy first, then check the copy, which the peer cannot change.
  SegmentLayout layout;
  layout.identity = shared.identity;
  layout.identity.version = version;
  layout.geometry = shared.geometry;
  check_identity(layout.identity, segment.size(), check);
  const ssp_geometry& g = layout.geometry;
  check_geometry(g, layout.identity, check);

  const std::size_t entry_bytes = g.channel_bytes;
  std::vector<std::byte> directory(g.channel_count * entry_bytes);
  std::memcpy(directory.data(), &segment[g.channels_offset], directory.size());
  layout.channels.resize(g.channel_count);
  for (std::size_t i = 0; i < layout.channels.size(); ++i) {
    std::memcpy(&layout.channels[i], &directory[i * entry_bytes], sizeof(ssp_channel));
    check_channel(layout.channels[i], i, g, check);
  }
  check_overlaps(layout.channels, check);
  check(layout.identity.layout_hash == layout_hash(g, directory), "layout_hash does not match the layout");
  return layout;
}

}  // namespace shm_protocol
