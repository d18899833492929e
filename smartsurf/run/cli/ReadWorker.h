// Commands that read a recording run as a whole in a forked and confined process, because HDF5 does not
// validate everything that it reads: any statement may crash on a damaged file, not only opening it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/confine/Confinement.h"
#include "common/files/PreparedOutputs.h"

namespace smartsurf::run {

struct ReadJob {
  std::string recording;
  std::function<int()> command;
  std::function<std::vector<common::PreparedOutput>()> prepare_outputs = nullptr;
  // The other files that it may read and write; nullopt: it is not confined.
  std::optional<common::Confinement> confinement = common::Confinement();
  // True if it only reads, within memory_to_read() and time_to_read_s().
  bool only_reads = true;
  // Runs before `command`, unconfined.
  std::function<void()> prepare = nullptr;
};

// Runs the command in a child, which ends with this process, and returns its exit status. Stop signals are
// passed on. Throws scene::InputError if the child crashes, and std::runtime_error if there can be no child.
// Call it on the main thread.
int read_in_worker(const ReadJob&);

}  // namespace smartsurf::run
