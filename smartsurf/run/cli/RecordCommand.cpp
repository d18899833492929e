// `smartsurf record`: records a surface that another process drives.
#include <CLI/CLI.hpp>
#include <memory>

#include "smartsurf/run/LiveRecording.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {

CommandHandler add_record_command(CLI::App& app, const std::string& command_line) {
  CLI::App* record = app.add_subcommand("record", "Record a running surface: simulator, bridge or fake");
  struct Flags {
    LiveRecordingOptions options;
    std::string file;
    std::uint64_t frames = 0;
    double wait_s = 10;
  };
  const auto flags = std::make_shared<Flags>();
  flags->options.command_line = command_line;
  record->add_option("--shm", flags->options.surface, "The surface's name in shared memory")
      ->required()
      ->type_name("NAME");
  record->add_option("-o,--output", flags->file, "The recording")->required()->type_name("FILE.h5");
  record->add_option("--frames", flags->frames, "End after N frames [with the surface]")
      ->type_name("N")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 62));
  record->add_option("--wait", flags->wait_s, "Seconds to wait for the surface [10]")
      ->type_name("S")
      ->check(CLI::Range(0.0, 1e6));
  return [flags] {
    flags->options.file = flags->file;
    const std::string extension = flags->options.file.extension().string();
    if (extension != ".h5" && extension != ".hdf5")
      throw scene::InputError("record: " + flags->file + ": the name must end in .h5 or .hdf5");
    if (flags->frames != 0) flags->options.frames = flags->frames;
    flags->options.wait = std::chrono::milliseconds(static_cast<std::int64_t>(flags->wait_s * 1e3));
    return record_live_surface(flags->options);
  };
}

}  // namespace smartsurf::run
