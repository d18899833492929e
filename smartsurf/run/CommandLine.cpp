#include "smartsurf/run/CommandLine.h"

#include <fmt/format.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>

#include "shm_protocol/Segments.h"
#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/record/Plot.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/run/Worlds.h"
#include "smartsurf/run/Simulation.h"

namespace smartsurf::run {
namespace {

std::atomic<bool> stop_requested{false};
std::atomic<int> stop_signal{0};

extern "C" void on_stop_signal(int signal) {
  // A second Ctrl-C ends at once a run that does not get to its next tick.
  if (stop_requested.exchange(true)) _exit(128 + signal);
  stop_signal = signal;
}

void catch_signals() {
  struct sigaction action {};
  action.sa_handler = on_stop_signal;
  for (const int s : {SIGINT, SIGTERM, SIGHUP}) sigaction(s, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
}

double positive_number(const std::string& flag, const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value) || value <= 0.0)
    throw scene::InputError(fmt::format("{} {}: must be a number greater than 0", flag, text));
  return value;
}

// FILE.png or FILE.png@SECONDS
Screenshot screenshot_of(const std::string& text) {
  const auto at = text.rfind('@');
  Screenshot shot{text.substr(0, at), std::nullopt};
  if (at != std::string::npos) {
    double seconds = 0.0;
    const std::string number = text.substr(at + 1);
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), seconds);
    if (error != std::errc{} || end != number.data() + number.size() || !std::isfinite(seconds) ||
        seconds < 0.0)
      throw scene::InputError(
          fmt::format("--screenshot {}: '{}' must be a time in seconds, as in before.png@0.5", text, number));
    shot.at_s = seconds;
  }
  if (!shot.file.ends_with(".png"))
    throw scene::InputError(fmt::format("--screenshot {}: the file's name must end in .png", text));
  return shot;
}

// The flags of `run` as the command line gives them, before they are judged.
struct RunFlags {
  std::string experiment, mode = "time-step", pace, controller, shm, stats, video;
  bool window = false, headless = false, no_controller = false, unsafe = false, help = false;
  std::vector<std::string> set, record, screenshot;
  std::optional<std::uint64_t> seed, ticks;
  std::string until;
  int threads = 1;
  int worlds = 0;  // 0: not asked for
};

void add_script_flags(CLI::App& app, RunFlags& f) {
  app.add_option("--seed", f.seed, "Seed of everything random, instead of the script's")->type_name("N");
  app.add_option("--set", f.set, "Value of an option that the script makes")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
}

void add_run_flags(CLI::App& app, RunFlags& f) {
  app.set_help_flag();  // our own, that also lists the experiment's options
  app.add_flag("-h,--help", f.help,
               "Show this help; with an experiment also the options that its script makes");
  app.add_option("experiment", f.experiment, "The experiment, a Lua script")->type_name("EXPERIMENT.lua");
  app.add_flag("--headless", f.headless, "Run without a window (the default)");
  app.add_flag("--window", f.window,
               "Open a window, and that of an APRON program beside it; runs in real time unless --pace says "
               "otherwise");
  app.add_option("--mode", f.mode,
                 "time-step: physics waits for the controller; passive: it follows the clock")
      ->check(CLI::IsMember({"time-step", "passive"}))
      ->type_name("MODE");
  app.add_option("--pace", f.pace, "max, realtime, or simulated seconds per second")->type_name("PACE");
  app.add_option("--until", f.until, "End at this simulated time")->type_name("SECONDS");
  app.add_option("--ticks", f.ticks, "End after so many control periods")->type_name("N");
  app.add_option("--shm", f.shm, "Name of the shared-memory surface (default: surface)")->type_name("NAME");
  app.add_option(
         "--controller", f.controller,
         "Start this controller and end it with the run: an APRON program, or a shell command in which {shm} "
         "is the surface's name")
      ->type_name("PROGRAM.aps|COMMAND");
  app.add_flag("--no-controller", f.no_controller, "Run without a controller: the script sets the actuators");
  add_script_flags(app, f);
  app.add_option("--threads", f.threads, "Threads for actuators and sensors; changes no result")
      ->check(CLI::Range(1, 256))
      ->type_name("N");
  app.add_option("--worlds", f.worlds,
                 "So many copies at once, with seeds counting up; NAME-0, NAME-1 … are their surfaces and files")
      ->check(CLI::Range(1, kMostWorlds))
      ->type_name("N");
  app.add_option("--record", f.record, "Record the run, as HDF5 or CSV")
      ->type_name("FILE.h5|FILE.csv")
      ->allow_extra_args(false);
  app.add_option("--stats", f.stats, "Write figures about the run as JSON")->type_name("FILE.json");
  app.add_option("--screenshot", f.screenshot, "Write a picture at a simulated time, or at the end")
      ->type_name("FILE.png[@SECONDS]")
      ->allow_extra_args(false);
  app.add_option("--video", f.video,
                 "Write a video, 30 pictures a simulated second; needs ffmpeg, no display")
      ->type_name("FILE.mp4");
  app.add_flag("--unsafe", f.unsafe, "Give the script the whole of Lua: processes, files, native modules");
}

std::optional<double> pace_of(const RunFlags& f) {
  if (f.pace == "max") return std::nullopt;
  if (f.pace == "realtime") return 1.0;
  if (!f.pace.empty()) {
    if (f.pace.find_first_not_of("0123456789.eE+-") != std::string::npos)
      throw scene::InputError(
          fmt::format("--pace {}: must be max, realtime or a number greater than 0", f.pace));
    return positive_number("--pace", f.pace);
  }
  const bool clocked = f.window || f.mode == "passive";
  return clocked ? std::optional(1.0) : std::nullopt;
}

using NameValues = std::vector<std::pair<std::string, std::string>>;

NameValues pairs_of(const std::vector<std::string>& settings) {
  NameValues pairs;
  for (const auto& text : settings) {
    const auto equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      throw scene::InputError(fmt::format("--set {}: must be NAME=VALUE", text));
    pairs.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  return pairs;
}

// For looking at an experiment without running it: what the script prints is not asked for.
script::Experiment load_silently(const std::string& file, NameValues set, std::optional<std::uint64_t> seed) {
  script::LoadOptions options;
  options.set = std::move(set);
  options.seed = seed;
  options.print = [](std::string_view) {};
  options.solids = std::make_shared<mesh::SolidLibrary>();
  return script::Experiment::load(file, options);
}

RunOptions judge(const RunFlags& f, const std::string& command_line) {
  auto reject_both = [](bool both, const char* what) {
    if (both) throw scene::InputError(fmt::format("{}: choose one", what));
  };
  if (f.experiment.empty()) throw scene::InputError("run: which experiment? smartsurf run EXPERIMENT.lua");
  reject_both(f.window && f.headless, "--window and --headless");
  reject_both(f.no_controller && !f.controller.empty(), "--controller and --no-controller");
  reject_both(f.no_controller && !f.shm.empty(), "--shm and --no-controller");
  reject_both(!f.until.empty() && f.ticks, "--until and --ticks");
  const bool pictures = f.window || !f.screenshot.empty() || !f.video.empty();
  if (f.worlds > 0 && pictures)
    throw scene::InputError("--worlds: many worlds have no window, screenshot or video; record them");
  RunOptions o;
  o.experiment = f.experiment;
  o.command_line = command_line;
  o.window = f.window;
  o.mode = f.mode == "passive" ? RunMode::kPassive : RunMode::kTimeStep;
  o.pace = pace_of(f);
  o.ticks = f.ticks;
  if (!f.until.empty()) o.until_s = positive_number("--until", f.until);
  o.shm = f.shm;
  o.controller = f.controller;
  o.no_controller = f.no_controller;
  o.seed = f.seed;
  o.set = pairs_of(f.set);
  o.threads = f.threads;
  o.recordings = f.record;
  o.stats_file = f.stats;
  for (const auto& text : f.screenshot) o.screenshots.push_back(screenshot_of(text));
  o.video_file = f.video;
  o.unsafe = f.unsafe;
  return o;
}

void print_options(const scene::SceneSpec& scene) {
  if (scene.options.empty()) {
    fmt::print("{} makes no options.\n", scene.file);
    return;
  }
  fmt::print("Options of {} (change one with --set NAME=VALUE):\n", scene.file);
  for (const auto& o : scene.options)
    fmt::print("  {:<28}{}\n", fmt::format("{} = {}", o.name, o.value), o.help);
}

int run_command(CLI::App& app, const RunFlags& flags, const std::string& command_line) {
  if (flags.help) {
    fmt::print("{}\n", app.help());
    if (!flags.experiment.empty())
      print_options(load_silently(flags.experiment, pairs_of(flags.set), flags.seed).scene());
    return kDone;
  }
  catch_signals();
  const RunOptions options = judge(flags, command_line);
  const int status = flags.worlds > 0 ? run_worlds(options, flags.worlds, stop_requested)
                                      : Run(options, stop_requested).execute();
  return status == kDone && stop_signal != 0 ? 128 + stop_signal : status;
}

int check_command(const RunFlags& flags) {
  const auto experiment = load_silently(flags.experiment, pairs_of(flags.set), flags.seed);
  const std::string& file = flags.experiment;
  const auto& scene = experiment.scene();
  check_surface(scene);
  fmt::print("{}: ok: {} x {} cells, {} objects, {} options\n", file, scene.surface.rows,
             scene.surface.columns, scene.objects.size(), scene.options.size());
  return kDone;
}

int clean_command(const std::string& prefix) {
  for (const auto& segment : shm_protocol::remove_orphans(prefix))
    fmt::print("removed {} ({} bytes, left by process {})\n", segment.name, segment.bytes,
               segment.surface_pid);
  for (const auto& segment : shm_protocol::list_segments())
    if (segment.ownership == shm_protocol::Ownership::kLiving && segment.name.starts_with(prefix))
      fmt::print("kept {}: process {} lives\n", segment.name, segment.surface_pid);
  return kDone;
}

void require_command(CLI::App& app, const std::string& name) {
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](CLI::App*) { return true; }))
    known.push_back(command->get_name());
  if (std::ranges::find(known, name) != known.end()) return;
  const std::string near = scene::nearest_name(name, known);
  throw scene::InputError(fmt::format("no command '{}'{}; known: {}", name,
                                      near.empty() ? "" : fmt::format(" (did you mean '{}'?)", near),
                                      fmt::join(known, ", ")));
}

int parse_and_run(int argc, char** argv) {
  CLI::App app{"Simulates a smart surface: a table of actuators and sensors that moves the objects on it.",
               "smartsurf"};
  app.set_version_flag("--version", "smartsurf " SMARTSURF_VERSION);
  app.require_subcommand(1);
  std::string command_line = "smartsurf";
  for (int i = 1; i < argc; ++i) command_line += std::string(" ") + argv[i];

  RunFlags flags;
  CLI::App* run = app.add_subcommand("run", "Run an experiment");
  add_run_flags(*run, flags);

  std::string file, output, what = "trajectories", prefix;
  CLI::App* info = app.add_subcommand("info", "Say what a recording holds");
  info->add_option("recording", file, "The recording")->required()->type_name("FILE.h5");
  CLI::App* plot = app.add_subcommand("plot", "Draw a figure from a recording");
  plot->add_option("recording", file, "The recording")->required()->type_name("FILE.h5");
  plot->add_option("-o,--output", output, "The figure, .svg or .png")
      ->required()
      ->type_name("FIG.svg|FIG.png");
  plot->add_option("--what", what, fmt::format("One of: {}", fmt::join(record::plot_kinds(), ", ")))
      ->type_name("KIND");
  CLI::App* check = app.add_subcommand("check", "Find the mistakes in an experiment without running it");
  check->add_option("experiment", flags.experiment, "The experiment")
      ->required()
      ->type_name("EXPERIMENT.lua");
  add_script_flags(*check, flags);
  CLI::App* clean = app.add_subcommand("clean", "Remove shared-memory segments that dead processes left");
  clean->add_option("prefix", prefix, "Only those whose names begin with this")->type_name("NAME");
  CLI::App* replay = app.add_subcommand("replay", "Not available in this version");
  replay->allow_extras();

  if (argc > 1 && argv[1][0] != '-') require_command(app, argv[1]);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    throw scene::InputError(fmt::format("{} (try smartsurf --help)", e.what()));
  }
  if (run->parsed()) return run_command(*run, flags, command_line);
  if (info->parsed()) {
    fmt::print("{}", record::info(record::Recording::open(file)));
    return kDone;
  }
  if (plot->parsed()) {
    const record::PlotKind kind = record::plot_kind(what);
    record::plot(record::Recording::open(file), kind, output);
    return kDone;
  }
  if (check->parsed()) return check_command(flags);
  if (clean->parsed()) return clean_command(prefix);
  throw scene::InputError("replay: not available in this version");
}

}  // namespace

int main(int argc, char** argv) noexcept {
  try {
    return parse_and_run(argc, argv);
  } catch (const scene::InputError& mistake) {
    fmt::print(stderr, "smartsurf: {}\n", mistake.what());
    return kUserError;
  } catch (const std::exception& failure) {
    fmt::print(stderr, "smartsurf: {}\n", failure.what());
    return kFailed;
  }
}

}  // namespace smartsurf::run
