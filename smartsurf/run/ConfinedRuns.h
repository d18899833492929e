// Confines the process before it reads an experiment: a broker, forked before, creates the files of its
// outputs, names them, removes the surface's segment, and starts and ends the controller. A guardian removes
// the segment of a run that is killed, or whose broker is.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "common/confine/Broker.h"
#include "common/confine/Confinement.h"
#include "common/files/Inputs.h"
#include "common/files/PreparedOutputs.h"
#include "common/process/Guardian.h"
#include "common/video/VideoEncoder.h"
#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/run/options/RunOptions.h"

namespace shm_protocol {
class SurfaceName;
}  // namespace shm_protocol

namespace smartsurf::run {

class ConfinedRuns {
 public:
  // Prepares the outputs of the runs, and `others` that replace_file() writes, and confines the process to
  // them. Refers to this object in each of `runs`, which must all be of one experiment and end before it.
  // Call it before the first thread, and before catch_stop_signals(). Confines nothing, and is not referred
  // to, where the script may do anything: --unsafe, extensions, a window. Throws scene::InputError.
  static std::unique_ptr<ConfinedRuns> confine(std::span<RunOptions> runs,
                                               const std::vector<common::NamedOutput>& others = {});
  ~ConfinedRuns();
  ConfinedRuns(const ConfinedRuns&) = delete;
  ConfinedRuns& operator=(const ConfinedRuns&) = delete;

  // The surface name, the video encoder (handed over) and the controller (started) of the run of that number.
  std::shared_ptr<shm_protocol::SurfaceName> surface_name(std::size_t run) const;
  std::unique_ptr<common::VideoEncoder> take_video(std::size_t run);
  std::unique_ptr<ControllerProcess> start_controller(std::size_t run);
  // Throws std::runtime_error if the broker has ended, without which the runs leave nothing.
  void require_broker();

 private:
  struct Prepared;
  explicit ConfinedRuns(std::span<const RunOptions> runs);
  void confine_to(std::span<RunOptions> runs, const std::vector<common::NamedOutput>& others);
  bool needs_broker() const;
  void start_broker();
  std::size_t first_service_of(std::size_t run) const;

  std::unique_ptr<Prepared> prepared_;
  std::unique_ptr<common::Guardian> guardian_;  // null if --shm names all segments
  std::unique_ptr<common::Broker> broker_;      // null if there is nothing to leave to it
};

// The folder and files that an experiment may read.
void add_experiment_files(common::Confinement&, const std::string& experiment);
// For `check`, which writes nothing.
void confine_to_experiment(const std::string& experiment, bool allow_extensions);

// Prepares a file that replace_file() writes. Throws scene::InputError.
common::PreparedOutput prepare_replaced_file(const common::NamedOutput&);
// Prepares the outputs of --screenshot and --video.
std::vector<common::PreparedOutput> prepare_media(std::span<const Screenshot>, const std::string& video_file);

}  // namespace smartsurf::run
