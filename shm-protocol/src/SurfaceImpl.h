// What a surface's endpoint consists of. Its life, its controller and publishing are in SurfaceEndpoint.cpp,
// the taking in of answers in SurfaceAnswers.cpp.
#pragma once

#include <unistd.h>

#include <array>

#include "Arrays.h"
#include "Geometry.h"
#include "Pieces.h"
#include "Process.h"
#include "Ring.h"
#include "Segment.h"
#include "Waiting.h"
#include "shm_protocol/SurfaceEndpoint.h"

namespace shm_protocol {

struct SurfaceEndpoint::Impl {
  Impl(const SurfaceConfig& config, Geometry plan)
      : geometry(std::move(plan)),
        segment(
            Segment::build(config.name, geometry.identity.segment_bytes, geometry.identity.surface_process)),
        header(*reinterpret_cast<ssp_header*>(segment.bytes().data())),
        sensors(Ring::of_sensors(geometry, segment.bytes().data())),
        actuators(Ring::of_actuators(geometry, segment.bytes().data())),
        hold_last_frame(config.hold_last_frame),
        in_place(config.answers_in_place && config.mode == Mode::kTimeStep),
        frames{Arrays(geometry.actuator_array_bytes()),
               in_place ? Arrays() : Arrays(geometry.actuator_array_bytes())} {
    write_fixed_part(geometry, config, segment.bytes());
    description = describe(geometry, segment.bytes());
    show_safe_frame();
    large = geometry.actuator_array_bytes() >= kLargeFrame;
    store_relaxed(header.sensors.cpu, current_cpu());
    set_state(State::kReady);
    sensors.open(1);
    store_release(header.identity.version, std::uint32_t{SSP_VERSION});
    segment.put_in_place();
  }

  void set_state(State next) noexcept {
    if (next == state) return;
    state = next;
    store_sequential(header.surface.state, static_cast<std::uint32_t>(next));
  }

  Status publish(std::uint64_t at_tick, double time_s, std::uint32_t status) noexcept;
  Status await_actuators(std::uint64_t at_tick, const WaitOptions&) noexcept;
  Status latest_actuators() noexcept;
  Status await_controller(const WaitOptions&) noexcept;

  // kOk while the controller we know is attached; adopts a new one; tells of the loss of the old one once.
  Status controller_status(bool look_up) noexcept;
  void adopt() noexcept;
  bool has_left() const noexcept;
  Status lose(Status how) noexcept;
  bool is_answer(std::uint32_t newest) const noexcept;
  Status take_in(std::uint32_t word) noexcept;
  bool next_now(int number, const ssp_channel&, std::span<const std::byte>& cells) noexcept;
  std::span<const std::byte> next_cells(int number, const WaitOptions&) noexcept;
  bool copy_piece(std::uint32_t of, std::uint32_t attached, std::size_t end) noexcept;
  void copy_arrays(std::uint32_t word, std::size_t from, std::size_t to) noexcept;
  void copy_all(std::uint32_t word) noexcept;
  void copy_along(std::uint32_t of) noexcept;
  void accept(const FrameInfo&) noexcept;
  void show_safe_frame() noexcept;
  void keep_shown_frame() noexcept;
  std::span<const std::byte> shown_cells(const ssp_channel& c) const noexcept {
    return shown_in_place ? actuators.array(info.frame, c) : frames[shown].bytes(c);
  }
  // Where the cells of the answer to come are, once they were checked.
  std::span<const std::byte> next_shown_cells(std::uint32_t of, const ssp_channel& c) const noexcept {
    return in_place ? actuators.array(of, c) : frames[1 - shown].bytes(c);
  }

  Geometry geometry;
  Segment segment;
  ssp_header& header;
  Ring sensors, actuators;
  Description description;
  pid_t owner = ::getpid();
  bool closed = false;

  State state = State::kNone;
  std::uint64_t frame = 0;  // published last
  std::uint64_t tick = 0;
  bool answered = false;  // the frame published last was answered
  bool settled = true;    // it was answered or given up: the next may be published

  std::uint32_t word = 0;  // of the actuator frame looked at last
  FrameInfo info;          // of the actuator frame shown
  bool hold_last_frame;
  bool in_place;                 // answers are checked and shown in their slots
  bool shown_in_place = false;   // and the one shown is: its slot stays as it is while the next one is made
  std::array<Arrays, 2> frames;  // else [shown] is what actuator() shows, the other takes the next frame in
  std::size_t shown = 0;
  std::uint64_t replaced = 0;  // values, in the copy made last
  Counters counters;

  ProcessWord controller = 0;            // whom we know
  std::uint32_t detachments = 0;         // counted when we adopted it, or lost the one before
  bool leaving = false;                  // it was about to leave then
  bool stranger_answered = false;        // one we did not know yet: its answer was there before we looked
  Patience patience, patience_for_more;  // for an answer; for its second piece and all that follow

  PieceWriter writer{header.sensor_progress, header.sensors.word, header.controller_waiting.flag,
                     geometry.sensor_array_bytes()};
  PieceReader pieces;
  Handout handout;
  bool large = false;  // actuator frames are
};

}  // namespace shm_protocol
