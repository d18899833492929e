// Attaches to a segment whose header, directory and slots a hostile surface wrote: either an error, or a
// description whose arrays all lie within the segment.
#include <algorithm>
#include <cstdlib>
#include <memory>

#include "Patches.h"
#include "shm-protocol/src/ring/Ring.h"
#include "shm-protocol/src/segment/SegmentLayout.h"
#include "shm_protocol/Error.h"

namespace {

using namespace shm_protocol;

SurfaceConfig config() {
  SurfaceConfig c;
  c.name = "fuzz";
  c.rows = 5;
  c.columns = 7;
  c.period_ns = 1'000'000;
  c.channels = {{"distance", Direction::kSensor, DType::kF32, 1, "u", 0, 8, 8},
                {"colour", Direction::kSensor, DType::kU8, 3, "", 0, 255, 0},
                {"height", Direction::kActuator, DType::kF32, 2, "u", -1, 4, 0.5}};
  c.positions.resize(35);
  return c;
}

volatile std::uint8_t sink;

// Reads the first and last byte of every array in every slot, under AddressSanitizer.
void read_all(const SegmentLayout& g, std::span<const std::byte> segment) {
  for (const ssp_direction direction : {SSP_SENSOR, SSP_ACTUATOR}) {
    const RingView ring(g, direction, segment.data());
    for (std::uint32_t frame = 0; frame < SSP_MAX_SLOTS; ++frame) {
      const FrameInfo stamp = ring.read_info(frame);
      if (stamp.frame != 0 && static_cast<std::uint32_t>(stamp.frame) != frame) std::abort();
      for (const auto& c : g.channels) {
        if (c.direction != static_cast<std::uint32_t>(direction)) continue;
        const auto array = ring.array(frame, c);
        if (array.empty() || array.data() < segment.data() ||
            array.data() + array.size() > segment.data() + segment.size())
          std::abort();
        sink = static_cast<std::uint8_t>(array.front()) ^ static_cast<std::uint8_t>(array.back());
      }
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const SurfaceConfig kConfig = config();
  static const SegmentLayout kPlan = [] {
    SegmentLayout g = plan_layout(kConfig);
    g.identity.surface_process = 1;
    g.identity.session = 1;
    return g;
  }();
  fuzz::Patches patches(data, size);
  const std::uint8_t form = patches.byte();
  const std::size_t real = kPlan.identity.segment_bytes;
  // Exactly as long as the segment, so that one byte too far is found; or shorter.
  const std::size_t bytes = form & 2 ? std::size_t{patches.byte()} * 67 % real : real;
  std::unique_ptr<std::byte, decltype(&std::free)> memory(
      static_cast<std::byte*>(std::aligned_alloc(4096, (real + 4095) / 4096 * 4096)), &std::free);
  std::fill_n(memory.get(), real, std::byte{0});
  write_layout(kPlan, kConfig, {memory.get(), real});
  auto& header = *reinterpret_cast<ssp_header*>(memory.get());
  header.identity.version = SSP_VERSION;
  // Header, directory and positions; a place beyond them wraps.
  while (patches.apply({memory.get(), std::min<std::size_t>(real, 4096 + 3 * sizeof(ssp_channel))})) {
  }
  if (form & 1) {  // else nearly all end at the hash
    const std::span all(memory.get(), real);
    const auto& g = header.geometry;
    if (g.channels_offset <= real &&
        std::uint64_t{g.channel_count} * g.channel_bytes <= real - g.channels_offset)
      header.identity.layout_hash =
          layout_hash(g, all.subspan(g.channels_offset, g.channel_count * g.channel_bytes));
  }
  // An allocation of the exact size, so that AddressSanitizer detects overruns.
  std::unique_ptr<std::byte, decltype(&std::free)> exact(
      static_cast<std::byte*>(std::malloc(bytes ? bytes : 1)), &std::free);
  std::copy_n(memory.get(), bytes, exact.get());
  const std::span<const std::byte> segment(exact.get(), bytes);
  try {
    if (const auto g = read_layout(segment, "fuzz")) {
      if (describe(*g, segment).channels.size() != g->channels.size()) std::abort();
      read_all(*g, segment);
    }
  } catch (const Error& e) {
    if (e.code() != ErrorCode::kCorrupt && e.code() != ErrorCode::kWrongVersion &&
        e.code() != ErrorCode::kForeign)
      std::abort();
  }
  return 0;
}
