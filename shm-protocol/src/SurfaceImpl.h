// The implementation of SurfaceEndpoint. SurfaceEndpoint.cpp contains the life cycle, controller tracking and
// publication; SurfaceAnswers.cpp receives answers.
#pragma once

#include <unistd.h>

#include <array>

#include "shm-protocol/src/ring/ChunkedTransfer.h"
#include "shm-protocol/src/ring/FrameArrays.h"
#include "shm-protocol/src/ring/Ring.h"
#include "shm-protocol/src/segment/ProcessIdentity.h"
#include "shm-protocol/src/segment/Segment.h"
#include "shm-protocol/src/segment/SegmentLayout.h"
#include "shm-protocol/src/wait/FutexWait.h"
#include "shm_protocol/SurfaceEndpoint.h"

namespace shm_protocol {

struct SurfaceEndpoint::Impl {
  Impl(const SurfaceConfig& config, SegmentLayout planned)
      : layout(std::move(planned)),
        segment(
            Segment::create(config.reserved ? config.reserved : std::make_shared<SurfaceName>(config.name),
                            layout.identity.segment_bytes)),
        header(*reinterpret_cast<ssp_header*>(segment.bytes().data())),
        sensors(layout, SSP_SENSOR, segment.bytes().data()),
        actuators(layout, SSP_ACTUATOR, segment.bytes().data()),
        hold_last_frame(config.hold_last_frame),
        answers_in_place(config.answers_in_place && config.mode == Mode::kTimeStep),
        frames{FrameArrays(layout.actuator_array_bytes()),
               answers_in_place ? FrameArrays() : FrameArrays(layout.actuator_array_bytes())} {
    write_layout(layout, config, segment.bytes());
    description = describe(layout, segment.bytes());
    apply_safe_values();
    chunked = layout.actuator_array_bytes() >= kMinChunkedFrameBytes;
    store_relaxed(header.sensors.cpu, current_cpu());
    set_state(State::kReady);
    sensors.begin_write(1);
    store_release(header.identity.version, std::uint32_t{SSP_VERSION});
    segment.rename_into_place();
  }

  void set_state(State next) noexcept {
    if (next == state) return;
    state = next;
    store_seq_cst(header.surface.state, static_cast<std::uint32_t>(next));
  }

  Status publish(std::uint64_t at_tick, double time_s, std::uint32_t status) noexcept;
  Status await_actuators(std::uint64_t at_tick, const WaitOptions&) noexcept;
  Status latest_actuators() noexcept;
  Status await_controller(const WaitOptions&) noexcept;

  // kOk while the adopted controller is attached. Adopts a new one; reports the loss of the old one once.
  Status controller_status(bool check_liveness) noexcept;
  void adopt_controller() noexcept;
  bool has_detached() const noexcept;
  Status release_controller(Status status) noexcept;
  bool is_answer(std::uint32_t newest) const noexcept;
  Status take_answer(std::uint32_t word) noexcept;
  bool try_next_cells(int channel_index, const ssp_channel&, std::span<const std::byte>& cells) noexcept;
  std::span<const std::byte> next_cells(int channel_index, const ssp_channel&, const WaitOptions&) noexcept;
  bool copy_chunk(std::uint32_t frame_number, std::uint32_t attached, std::size_t end) noexcept;
  void copy_arrays(std::uint32_t word, std::size_t from, std::size_t to) noexcept;
  void copy_all(std::uint32_t word) noexcept;
  void copy_committed(std::uint32_t frame_number) noexcept;
  void accept_frame(const FrameInfo&) noexcept;
  void count_clamped(std::uint64_t values) noexcept;
  void apply_safe_values() noexcept;
  void preserve_current_frame() noexcept;
  std::span<const std::byte> current_cells(const ssp_channel& c) const noexcept {
    return current_in_place ? actuators.array(info.frame, c) : frames[current].bytes(c);
  }
  // The checked cells of the answer being received.
  std::span<const std::byte> incoming_cells(std::uint32_t frame_number, const ssp_channel& c) const noexcept {
    return answers_in_place ? actuators.array(frame_number, c) : frames[1 - current].bytes(c);
  }

  SegmentLayout layout;
  Segment segment;
  ssp_header& header;
  Ring sensors, actuators;
  Description description;
  pid_t owner_pid = ::getpid();
  bool closed = false;

  State state = State::kNone;
  std::uint64_t frame = 0;  // last published
  std::uint64_t tick = 0;   // of that frame
  bool answered = false;    // the last published frame was answered
  bool may_publish = true;  // the last published frame was answered or abandoned

  std::uint32_t last_word = 0;  // of the last actuator frame examined
  FrameInfo info;               // of the current actuator frame
  bool hold_last_frame;
  bool answers_in_place;              // answers are returned in their slots, unchecked
  bool current_in_place = false;      // the current frame is in its slot, which the next frame does not reuse
  std::array<FrameArrays, 2> frames;  // [current] backs actuator(); the other receives the next frame
  std::size_t current = 0;
  std::uint64_t replaced = 0;  // values replaced in the last copy
  Counters counters;

  ProcessIdentity controller = 0;               // the adopted controller; 0: none
  std::uint32_t known_detached = 0;             // claim.detached at the last adoption or loss
  bool controller_closing = false;              // the controller was already closing when adopted
  bool unknown_answered = false;                // an answer arrived before its controller was adopted
  WaitState wait_state, next_chunk_wait_state;  // for the first chunk or a whole answer; for later chunks

  ChunkWriter writer{header.sensor_progress, header.sensors.word, header.controller_waiting.flag,
                     layout.sensor_array_bytes()};
  ChunkReader chunk_reader;
  ChunkCursor cursor;
  bool chunked = false;  // actuator frames are large enough to be read chunk by chunk
};

}  // namespace shm_protocol
