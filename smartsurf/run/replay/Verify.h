// `smartsurf replay --verify`: runs a recorded experiment again and compares every recorded frame.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "common/files/UnfinishedFile.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/simulation/Simulation.h"

namespace smartsurf::run {

struct VerificationResult {
  std::uint64_t frames_compared = 0;
  std::uint64_t last_tick = 0;                        // of the last frame compared
  std::optional<std::uint64_t> first_different_tick;  // nullopt if all frames are identical
  // The first difference at that tick: the object, its recorded and its present state.
  std::string difference;
  bool interrupted = false;  // by `stop`
};

struct Allowed {
  bool unsafe = false;      // a script that was recorded with --unsafe may run
  bool extensions = false;  // the script may load the extensions that it names
};

// A temporary folder for the script's output, removed by the destructor.
class TemporaryFolder {
 public:
  TemporaryFolder();  // in TMPDIR; throws scene::InputError or std::runtime_error
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::filesystem::path path() const { return path_; }

 private:
  std::string path_;
  std::optional<common::UnfinishedFile> unfinished_;
};

// The experiment's file, if it is still there and unchanged: then its folder holds what the run read. A
// recording could name any file in any folder. A process of its own reads the recording. Nullopt, too, if
// that cannot be read.
std::optional<std::filesystem::path> find_unchanged_experiment(const std::filesystem::path& recording);

// Runs the script text stored in the recording with the recorded options and seed; other files are read from
// their original paths. Actuator targets set by a controller are taken from the recording, so no controller
// runs. progress: called with the simulated time of each frame. Throws scene::InputError if the recording
// cannot be reproduced: the user intervened, the inputs were not recorded, the script is unsafe and not
// allowed, or an extension is missing or has other content. observe: called for each frame that is identical;
// false ends the run.
VerificationResult verify(const record::Recording&, int threads, const Allowed&,
                          const std::filesystem::path& output_folder, const std::atomic<bool>& stop,
                          const std::function<void(double)>& progress,
                          const std::function<bool(const simulation::Simulation&)>& observe = {});

}  // namespace smartsurf::run
