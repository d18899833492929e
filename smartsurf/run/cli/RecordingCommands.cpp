// `smartsurf info`, `plot`, `export` and `clean`: the subcommands for finished runs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "common/files/Inputs.h"
#include "common/process/ExitStatus.h"
#include "common/text/Printable.h"
#include "shm_protocol/Segments.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/record/plot/Plot.h"
#include "smartsurf/run/ConfinedRuns.h"
#include "smartsurf/run/PythonModule.h"
#include "smartsurf/run/cli/ReadWorker.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/run/options/FlagValues.h"
#include "smartsurf/web/GltfFile.h"
#include "smartsurf/web/Page.h"

namespace smartsurf::run {
namespace {

void refuse_to_overwrite(const std::string& input, const std::string& flag, const std::string& output) {
  common::note_input(input);
  common::require_separate_outputs(std::vector<common::NamedOutput>{{flag, output}});
}

int clean_command(const std::string& prefix) {
  const auto removed = shm_protocol::remove_orphans(prefix);
  bool is_any_kept = false;
  for (const auto& segment : removed)
    common::print_output(fmt::format("removed {} ({} bytes, left by process {})\n", segment.name,
                                     segment.bytes, segment.surface_pid));
  for (const auto& segment : shm_protocol::list_segments())
    if (segment.ownership == shm_protocol::Ownership::kLiving && segment.name.starts_with(prefix)) {
      is_any_kept = true;
      common::print_output(
          fmt::format("kept {}: process {} is running\n", segment.name, segment.surface_pid));
    }
  if (removed.empty() && !is_any_kept) common::print_output("nothing to remove\n");
  return common::kDone;
}

}  // namespace

CommandHandler add_info_command(CLI::App& app) {
  CLI::App* info = app.add_subcommand("info", "Print a summary of a recording");
  struct Flags {
    std::string file;
    bool datasets = false;
  };
  const auto flags = std::make_shared<Flags>();
  info->add_option("recording", flags->file, "The recording")->required()->type_name("FILE.h5");
  info->add_flag("--datasets", flags->datasets, "List its datasets and their extents instead");
  return [flags] {
    return read_in_worker({flags->file, [&]() -> int {
                             const record::Recording recording = record::Recording::open(flags->file);
                             common::print_output(flags->datasets ? record::list_datasets(recording)
                                                                  : record::describe_recording(recording));
                             return common::kDone;
                           }});
  };
}

CommandHandler add_plot_command(CLI::App& app) {
  struct Flags {
    std::string file, output, what = "trajectories";
  };
  CLI::App* plot =
      app.add_subcommand("plot", "Draw a figure from a recording, or a chart from its description");
  const auto flags = std::make_shared<Flags>();
  plot->add_option("recording", flags->file, "The recording, or a chart in JSON")
      ->required()
      ->type_name("FILE.h5|FILE.json");
  plot->add_option("-o,--output", flags->output, "The figure, .svg, .pdf or .png")
      ->required()
      ->type_name("FIG.svg|FIG.pdf|FIG.png");
  const CLI::Option* const what =
      plot->add_option("--what", flags->what,
                       fmt::format("One of: {}; or CHANNEL:ROW,COLUMN of a recorded channel",
                                   fmt::join(record::plot_kinds(), ", ")))
          ->type_name("KIND");
  return [flags, what]() -> int {
    refuse_to_overwrite(flags->file, "-o", flags->output);
    const bool is_chart = flags->file.ends_with(".json");
    if (is_chart && what->count() > 0)
      throw scene::InputError("--what: needs a recording; a chart in JSON says what it shows");
    common::Confinement fonts;
    common::add_picture_files(fonts);
    return read_in_worker({flags->file,
                           [&]() -> int {
                             if (is_chart)
                               record::write_chart(flags->file, flags->output);
                             else
                               record::write_plot(record::Recording::open(flags->file), flags->what,
                                                  flags->output);
                             return common::kDone;
                           },
                           [&] {
                             return std::vector{prepare_replaced_file({"-o", flags->output})};
                           },
                           fonts});
  };
}

CommandHandler add_export_command(CLI::App& app) {
  struct Flags {
    std::string file, output, fps = "30";
  };
  CLI::App* command = app.add_subcommand(
      "export", "Make a web page that plays a recording in any browser, or a file for other tools");
  const auto flags = std::make_shared<Flags>();
  command->add_option("recording", flags->file, "The recording")->required()->type_name("FILE.h5");
  command
      ->add_option("-o,--output", flags->output,
                   "The page; a glTF model; or, with the Python package, a USD scene, a Rerun recording or a "
                   "log of ROS 2 messages")
      ->required()
      ->type_name("FILE.html|glb|usd|rrd|mcap");
  command->add_option("--fps", flags->fps, "Maximum frames per recorded second (default: 30)")
      ->type_name("N");
  return [flags] {
    const std::string extension = std::filesystem::path(flags->output).extension().string();
    const bool is_model = extension == ".glb";
    refuse_to_overwrite(flags->file, "-o", flags->output);
    const double fps = parse_positive_number("--fps", flags->fps);
    for (const char* const other : {".usd", ".usda", ".usdc", ".rrd", ".mcap"})
      if (extension == other) run_python("formats", {flags->file, "-o", flags->output, "--fps", flags->fps});
    if (!is_model && extension != ".html")
      throw scene::InputError(
          fmt::format("export -o {}: the name must end in .html, .glb, .usd, .usda, .usdc, .rrd or .mcap",
                      flags->output));
    return read_in_worker({flags->file,
                           [&, is_model]() -> int {
                             const record::Recording recording = record::Recording::open(flags->file);
                             if (is_model)
                               web::write_gltf(recording, flags->output, {fps});
                             else
                               web::write_page(recording, flags->output, {fps});
                             return common::kDone;
                           },
                           [&] {
                             return std::vector{prepare_replaced_file({"-o", flags->output})};
                           }});
  };
}

CommandHandler add_clean_command(CLI::App& app) {
  CLI::App* clean = app.add_subcommand("clean", "Remove shared-memory segments left by dead processes");
  const auto prefix = std::make_shared<std::string>();
  const CLI::Option* const given =
      clean->add_option("prefix", *prefix, "Remove only segments whose names begin with NAME")
          ->type_name("NAME");
  return [prefix, given] {
    if (given->count() > 0 && prefix->empty())
      throw scene::InputError("clean '': must be the beginning of a name; without one, all are removed");
    return clean_command(*prefix);
  };
}

}  // namespace smartsurf::run
