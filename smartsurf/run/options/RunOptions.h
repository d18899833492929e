// The options of `smartsurf run`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/files/Inputs.h"
#include "smartsurf/run/ShownRegisters.h"
#include "smartsurf/run/options/RenderOptions.h"
#include "smartsurf/scene/NamedValues.h"

namespace smartsurf::run {

enum class RunMode { kTimeStep, kPassive };

struct Screenshot {
  std::string file;
  std::optional<double> time_s;  // nullopt: at the end of the run
};

struct RunOptions {
  std::string experiment;
  std::string command_line;  // as typed; stored in recordings
  bool window = false;
  bool paused = false;   // start paused; needs a window
  bool summary = false;  // print one line at the end: outcome, speed, files
  bool close = false;    // close the window at the end instead of showing the result
  RunMode mode = RunMode::kTimeStep;
  // Simulated seconds per wall second; nullopt: as fast as possible.
  std::optional<double> pace;
  std::optional<std::uint64_t> ticks;  // nullopt: no limit
  std::optional<double> until_s;
  std::string shm;         // segment name, to which worlds append their index; "": chosen by the run
  std::string controller;  // "": wait for one to attach
  std::vector<std::string> controller_overrides;  // NAME=VALUE, validated by apron
  std::shared_ptr<ShownRegisters> registers;      // of the APRON program; null: it shows none
  bool no_controller = false;
  std::optional<std::uint64_t> seed;
  std::optional<std::string> engine;  // nullopt: the script's
  scene::Overrides overrides;
  int threads = 1;
  std::vector<std::string> recording_files;
  std::string stats_file;
  std::vector<Screenshot> screenshots;
  std::string video_file;
  RenderOptions render;
  bool unsafe = false;
  bool allow_extensions = false;
  std::optional<int> world_index;  // nullopt: the only world of this process
  // The tasks that the run leaves to another process, and its number there (ConfinedRuns.h); null: none.
  class ConfinedRuns* confined = nullptr;
  std::size_t confined_number = 0;
};

// The name of the surface of a run with a controller.
std::string segment_name(const RunOptions&);
// The folder in which the script may write: its own, beside the first recording; empty: none.
std::filesystem::path script_output_folder(const RunOptions&);

// Every file that the run writes.
std::vector<common::NamedOutput> named_outputs(const RunOptions&);

// The options of an experiment that the user opens in a window: the APRON program beside it that has its name
// controls it, or else nothing does. previous: the options of the run whose window it is.
RunOptions options_for_opened(const std::string& experiment, const RunOptions& previous);

}  // namespace smartsurf::run
