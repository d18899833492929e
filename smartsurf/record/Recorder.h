// Records a run to a file, tick by tick: HDF5 (.h5, .hdf5) or CSV (.csv); docs/recordings.md describes both.
//
// Failure: open() throws scene::InputError if the path cannot be a recording (extension, directory,
// permission, a file that another run is writing); frame() and close() throw std::runtime_error when writing
// fails (disk full), after which all calls do nothing. Frames are buffered and written about 64 at a time or
// once a second, so that most ticks only copy memory; a killed process leaves a readable file that ends with
// the last write. frame() allocates in its first call and when objects are added. A recorder is used by one
// thread at a time. Calls into HDF5, which Debian builds without locks, are serialised among recorders; no
// other user of HDF5 may run beside them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/scene/ChannelData.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::record {

struct NamedText {
  std::string name, value;
};

// What the recording says about the run beyond its SceneSpec.
struct RunMetadata {
  std::string command_line;
  std::string mode;                  // "time-step" or "passive"
  std::string program_file;          // the controller's program as the user named it; "" when there is none
  std::string program_text;          // its source
  std::string driver;                // who sets the actuators: "script" or "controller"
  std::vector<NamedText> overrides;  // --set NAME=VALUE, in order
  bool unsafe = false;               // --unsafe
  std::vector<NamedText>
      versions;  // of what computed the run: {"physics", "0.1.0"}, …; the recorder adds its own
};

// How the run ended.
struct RunResult {
  std::string outcome;           // one line: "done", "stopped by the user", "failed at tick 12: …"
  std::uint64_t ticks = 0;       // control periods simulated, whether recorded or not
  double simulated_s = 0.0;      // simulated seconds
  std::uint64_t state_hash = 0;  // of the final state
};

class Recorder {
 public:
  static std::unique_ptr<Recorder> open(const std::filesystem::path& path, const RunMetadata& meta,
                                        const scene::SceneSpec& spec);
  virtual ~Recorder() = default;  // without close(): what is buffered is written, and no result
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // What the actuators are told, all channels: to be called at every tick, before frame(). With it the run
  // can be run again without whoever drove it.
  virtual void record_inputs(std::span<const scene::ChannelData>) {}
  // Somebody touches the run by hand after this tick: it cannot be run again. The first call counts.
  virtual void mark_user_interaction(std::uint64_t) {}

  // To be called at every tick; keeps the first and then every `spec.record.every`-th.
  // catalogue: every object ever created, index = id; it only grows.
  void record_frame(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                    std::span<const scene::ChannelData> sensors = {},
                    std::span<const scene::ChannelData> actuators = {}) {
    if (frame_calls_++ % tick_interval_ == 0) write_frame(snapshot, catalogue, sensors, actuators);
  }
  virtual void close(const RunResult& result) = 0;

 protected:
  explicit Recorder(int tick_interval)
      : tick_interval_(tick_interval < 1 ? 1 : static_cast<std::uint64_t>(tick_interval)) {}

 private:
  virtual void write_frame(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                           std::span<const scene::ChannelData> sensors,
                           std::span<const scene::ChannelData> actuators) = 0;

  std::uint64_t tick_interval_, frame_calls_ = 0;
};

}  // namespace smartsurf::record
