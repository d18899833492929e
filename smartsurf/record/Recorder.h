// Records a run to a file, tick by tick; OpenRecorder.h opens one.
//
// Failure: record_frame() and close() throw std::runtime_error if writing fails (disk full); all later calls
// then do nothing. record_frame() throws scene::InputError if a channel has an invalid name.
// Buffering: frames are written about 64 at a time or once a second, so most ticks only copy memory. A killed
// process leaves a readable file that ends with the last write.
// Allocation: record_frame() allocates in its first call and when objects or metrics are added.
// Processes: a recorder belongs to the process that opened it. In a child of fork() it does nothing, whatever
// is called, and the file stays the parent's. Threads: a recorder is used by one thread at a time. Recorders
// serialise their calls into HDF5, which Debian builds without locks; nothing else in the process may call
// HDF5 concurrently.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "smartsurf/scene/ChannelData.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/scene/Variation.h"

namespace smartsurf::record {

// Frames wait at most this long before they are written.
inline constexpr std::chrono::seconds kMaxFlushInterval{1};

struct NamedText {
  std::string name, value;
};

using NamedNumber = std::pair<std::string, double>;

// A channel of a live surface, which no sensor or actuator of the SceneSpec describes.
struct LiveChannel {
  std::string name;
  bool sensor = true;
  std::string unit;
  double minimum = 0.0, maximum = 1.0;
};

// Numbers of a frame beside its channels: a row of the dataset /group/name. Either words or reals.
struct LiveRow {
  std::string_view group, name;  // group "": the root
  std::span<const std::uint64_t> words;
  std::span<const float> reals;
};

// The data of a run that a recording stores besides its SceneSpec.
struct RunMetadata {
  std::string command_line;
  std::string mode;          // "time-step" or "passive"
  std::string program_file;  // the controller's program as given by the user; "" if there is none
  std::string program_text;  // its source
  std::string driver;        // what sets the actuators: "script", "controller", or "python" and the script
  std::vector<NamedText> overrides;  // --set NAME=VALUE, in order
  bool unsafe = false;               // --unsafe
  // The experiment declares success(). nullopt: a version recorded it that did not store this.
  std::optional<bool> declares_success = {};
  // Versions of the components that computed the run: {"physics", "0.1.0"}, …; the recorder adds its own.
  std::vector<NamedText> versions;
  std::vector<NamedText> extensions;          // the hashes of the extensions' files, by the files' names
  std::vector<scene::Variation> varied = {};  // the nuisances of the episode, with the values drawn
  // False: a surface was observed, of which no seed, engine, step or other setting of a world is known.
  bool is_simulated = true;
  std::vector<LiveChannel> live_channels = {};  // of an observed surface
};

// The end of a run.
struct RunResult {
  std::string outcome;       // one line: "done", "stopped by the user", "failed at tick 12: …"
  std::uint64_t ticks = 0;   // control periods simulated, recorded or not
  double simulated_s = 0.0;  // simulated time, s
  std::optional<std::uint64_t> state_hash = {};  // of the final state; nullopt: of an observed surface
  std::optional<bool> success = {};              // the experiment's goal was reached; nullopt: it has none
  std::optional<double> success_s = {};          // when it was first reached
  std::vector<NamedNumber> metrics = {};         // their values after on_finish; NaN: none
};

class Recorder {
 public:
  // Without close(), writes what is buffered, but no result.
  virtual ~Recorder() = default;
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // Records the targets of all actuator channels, so that the run can be reproduced without its controller.
  // Call at every tick, before record_frame().
  virtual void record_inputs(std::span<const scene::ChannelData>) {}
  // Notes that the user intervened after this tick, so that the run cannot be reproduced. Only the first call
  // has an effect.
  virtual void mark_user_interaction(std::uint64_t) {}

  // The registers with which the controller's program led to the next frame. None until it has answered;
  // then always the same, in the same order.
  virtual void record_registers(std::span<const scene::ChannelData>) {}

  // The numbers that belong to the next frame; every frame has the same rows. With tick_interval 1 only.
  virtual void record_live(std::span<const LiveRow>) {}
  // Writes what is buffered.
  virtual void flush() {}

  // Call at every tick; keeps the first frame and then every `spec.record.tick_interval`-th.
  // catalogue: every object ever created, index = id; it only grows.
  // metrics: the script's, in an order that stays; new ones follow the earlier ones.
  void record_frame(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                    std::span<const scene::ChannelData> sensors = {},
                    std::span<const scene::ChannelData> actuators = {},
                    std::span<const NamedNumber> metrics = {}) {
    if (frame_calls_++ % tick_interval_ == 0) write_frame(snapshot, catalogue, sensors, actuators, metrics);
  }
  virtual void close(const RunResult& result) = 0;

 protected:
  explicit Recorder(int tick_interval)
      : tick_interval_(tick_interval < 1 ? 1 : static_cast<std::uint64_t>(tick_interval)) {}

 private:
  virtual void write_frame(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                           std::span<const scene::ChannelData> sensors,
                           std::span<const scene::ChannelData> actuators,
                           std::span<const NamedNumber> metrics) = 0;

  std::uint64_t tick_interval_, frame_calls_ = 0;
};

}  // namespace smartsurf::record
