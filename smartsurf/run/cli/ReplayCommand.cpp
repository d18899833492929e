// `smartsurf replay`: shows a recording, or runs it again and compares.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>

#include "common/files/Inputs.h"
#include "common/process/ExitStatus.h"
#include "common/process/StopSignals.h"
#include "common/text/Printable.h"
#include "smartsurf/run/ConfinedRuns.h"
#include "smartsurf/run/cli/ReadWorker.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/run/cli/WindowSession.h"
#include "smartsurf/run/options/FlagValues.h"
#include "smartsurf/run/output/MediaWriter.h"
#include "smartsurf/run/output/Progress.h"
#include "smartsurf/run/replay/Replay.h"
#include "smartsurf/run/replay/Verify.h"
#include "smartsurf/scene/KindRegistry.h"

namespace smartsurf::run {
namespace {

struct ReplayFlags {
  std::string file, video, pace;
  std::vector<std::string> screenshot;
  RenderFlags render;
  bool window = false, verify = false, unsafe = false, allow_extensions = false;
  int threads = 1;
};

int verify_recording(const record::Recording& recording, const ReplayFlags& flags,
                     const std::filesystem::path& output_folder) {
  const auto& stop = common::catch_stop_signals();
  Progress progress;
  const double until_s = recording.frames() > 0 ? recording.times().back() : 0.0;
  const VerificationResult result =
      verify(recording, flags.threads, {flags.unsafe, flags.allow_extensions}, output_folder, stop,
             [&](double simulated_s) { progress.update(simulated_s, until_s); });
  const std::string file = recording.path().string();
  if (result.first_different_tick) {
    progress.print_message(
        fmt::format("{}: differs at tick {}: {}", file, *result.first_different_tick, result.difference));
    return common::kFailed;
  }
  if (result.interrupted) {
    progress.print_message(fmt::format("{}: stopped; identical up to tick {}", file, result.last_tick));
    return common::status_after_signals(common::kDone);
  }
  common::print_output(fmt::format("{}: identical in {} frames, up to tick {}{}\n", file,
                                   result.frames_compared, result.last_tick,
                                   recording.result() ? "" : " (the run did not finish)"));
  return common::kDone;
}

int verify_in_worker(const ReplayFlags& flags) {
  common::catch_stop_signals();  // one would leave the folder
  const TemporaryFolder output_folder;
  ReadJob job{
      .recording = flags.file,
      .command =
          [&] { return verify_recording(record::Recording::open(flags.file), flags, output_folder.path()); },
      .only_reads = false};
  const std::string reason = flags.unsafe                          ? "with --unsafe"
                             : flags.allow_extensions              ? "with --allow-extensions"
                             : !scene::loaded_extensions().empty() ? "with --load"
                                                                   : "";
  if (reason.empty()) {
    job.confinement->write_folders.push_back(output_folder.path());
    if (const auto experiment = find_unchanged_experiment(flags.file))
      add_experiment_files(*job.confinement, experiment->string());
  } else {
    common::leave_unconfined(reason);
    job.confinement = std::nullopt;
  }
  return read_in_worker(job);
}

int replay_command(const ReplayFlags& flags) {
  const bool writes_media = !flags.video.empty() || !flags.screenshot.empty();
  reject_both(flags.window && writes_media, "--window and --video or --screenshot");
  reject_both(flags.verify && (flags.window || writes_media),
              "--verify and --window, --video or --screenshot");
  std::vector<Screenshot> screenshots;
  for (const auto& text : flags.screenshot) screenshots.push_back(parse_screenshot(text));
  const double pace = flags.pace.empty() ? 1.0 : parse_positive_number("--pace", flags.pace);
  if (!flags.render.plots.empty() && (flags.verify || writes_media))
    throw scene::InputError("--plot: needs the window; smartsurf plot draws the signals of a recording");
  const RenderOptions render = parse_render_options(flags.render);
  if (flags.verify) return verify_in_worker(flags);
  ReadJob job{.recording = flags.file, .command = nullptr, .only_reads = false};
  if (!writes_media) {
    common::leave_unconfined("with a window");
    job.confinement = std::nullopt;
    job.command = [&] { return common::status_after_signals(replay_session(flags.file, pace, render)); };
    return read_in_worker(job);
  }
  std::vector<common::NamedOutput> outputs;
  for (const Screenshot& screenshot : screenshots) outputs.push_back({"--screenshot", screenshot.file});
  if (!flags.video.empty()) outputs.push_back({"--video", flags.video});
  common::note_input(std::filesystem::path(flags.file));
  common::require_separate_outputs(outputs);
  job.prepare_outputs = [&] { return prepare_media(screenshots, flags.video); };
  job.confinement->calls = common::Confinement::Calls::kPictures;
  common::add_picture_files(*job.confinement);
  // Sensors that the recording lacks come from another run, which may read what the first one read.
  std::optional<TemporaryFolder> output_folder;
  if (!render.view.overlay.channel.empty()) {
    common::catch_stop_signals();
    output_folder.emplace();
    job.confinement->write_folders.push_back(output_folder->path());
    if (const auto experiment = find_unchanged_experiment(flags.file))
      add_experiment_files(*job.confinement, experiment->string());
  }
  std::unique_ptr<common::VideoEncoder> video;
  job.prepare = [&] { video = start_video(flags.video, render); };
  job.command = [&] {
    const record::Recording recording = record::Recording::open(flags.file);
    const auto& stop = common::catch_stop_signals();
    if (output_folder && needs_rerun(recording, render))
      rerun_to_media(recording, screenshots, std::move(video), render, output_folder->path(), stop);
    else
      replay_to_media(recording, screenshots, std::move(video), render, stop);
    return common::status_after_signals(common::kDone);
  };
  return read_in_worker(job);
}

}  // namespace

CommandHandler add_replay_command(CLI::App& app) {
  CLI::App* replay = app.add_subcommand("replay", "Show a recording, or run it again and compare");
  const auto flags = std::make_shared<ReplayFlags>();
  replay->add_option("recording", flags->file, "The recording")->required()->type_name("FILE.h5");
  replay->add_flag("--window", flags->window, "Play it in a window (the default)");
  replay->add_option("--pace", flags->pace, "Recorded seconds per second, in the window")
      ->type_name("FACTOR");
  replay->add_option("--video", flags->video, "Write a video, 30 frames per recorded second; needs ffmpeg")
      ->type_name("FILE.mp4");
  replay->add_option("--screenshot", flags->screenshot, "Write a picture at a recorded time, or at the end")
      ->type_name("FILE.png[@SECONDS]")
      ->allow_extra_args(false);
  add_render_flags(*replay, flags->render);
  replay->add_flag("--verify", flags->verify,
                   "Run the recorded experiment again and name the first tick and object that differ");
  replay->add_option("--threads", flags->threads, "Threads for --verify; changes no result")
      ->check(CLI::Range(1, 256))
      ->type_name("N");
  add_extension_flags(*replay, flags->allow_extensions);
  replay->add_flag("--unsafe", flags->unsafe, "Let --verify run a script that was recorded with --unsafe");
  return [flags] { return replay_command(*flags); };
}

}  // namespace smartsurf::run
