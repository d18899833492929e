#include "apron/run/cli/Options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <limits>

#include "apron/program/Program.h"
#include "common/cli/ParseErrors.h"

namespace apron::run {
namespace {

constexpr const char* kFooter =
    "Exit status: 0 success, also when the surface ends the session; 1 run-time error; 2 invalid input\n"
    "(command line, program, file, channel); 3 surface lost; 128 + n after signal n (130 after Ctrl-C),\n"
    "cleanly detached. Files that a program opens or saves are relative to the current directory.";

template <class Number>
bool parse_number(std::string_view text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() && !text.empty();
}

CLI::Validator whole_number_validator(std::uint64_t min_value, std::uint64_t max_value) {
  return {[=](std::string& text) {
            std::uint64_t value = 0;
            if (parse_number(text, value) && value >= min_value && value <= max_value) return std::string();
            return "'" + text + "' is not a whole number from " + std::to_string(min_value) + " to " +
                   std::to_string(max_value);
          },
          ""};
}

CLI::Validator seconds_validator() {
  return {[](std::string& text) {
            double value = 0;
            if (parse_number(text, value) && value >= 0.0 && value <= 1e6) return std::string();
            return "'" + text + "' is not a time in seconds from 0 to 1000000";
          },
          ""};
}

// Options as typed by the user, before validation.
struct RawOptions {
  Options options;
  std::string size, profile, isa, pace, frames_per_s;
  std::vector<std::string> sets, keys, saves;
  std::string geometry;
  std::vector<std::string> screenshots;
};

void parse_size(RawOptions& raw) {
  const std::size_t x = raw.size.find('x');
  Options& options = raw.options;
  const std::string_view text = raw.size;
  const bool valid = x != std::string::npos && parse_number(text.substr(0, x), options.width) &&
                     parse_number(text.substr(x + 1), options.height) && options.width > 0 &&
                     options.height > 0 && std::size_t{options.width} * options.height <= program::kMaxCells;
  if (!valid)
    throw CLI::ValidationError("--size", "'" + raw.size +
                                             "' is not WIDTHxHEIGHT, such as 64x64, of at most " +
                                             std::to_string(program::kMaxCells) + " cells");
}

void parse_parameter(RawOptions& raw, const std::string& text) {
  const std::size_t equals = text.find('=');
  float value = 0;
  if (equals == std::string::npos || equals == 0 ||
      !parse_number(std::string_view(text).substr(equals + 1), value) || !std::isfinite(value))
    throw CLI::ValidationError("--set", "'" + text + "' is not NAME=VALUE with a number, such as speed=0.5");
  raw.options.parameters[text.substr(0, equals)] = value;
}

double parse_positive(const std::string& option, const std::string& text, double max_value,
                      const std::string& expected) {
  double value = 0;
  if (parse_number(text, value) && value > 0.0 && value <= max_value) return value;
  throw CLI::ValidationError(option, "'" + text + "' is not " + expected);
}

void parse_frame_rate(RawOptions& raw) {
  FrameRate& rate = raw.options.frame_rate;
  if (!raw.options.surface.empty()) {
    if (!raw.pace.empty() || !raw.frames_per_s.empty())
      throw CLI::ValidationError(raw.pace.empty() ? "--fps" : "--pace",
                                 "cannot be combined with --shm: the surface sets the pace");
    return;
  }
  if (!raw.frames_per_s.empty())
    rate.per_s = parse_positive("--fps", raw.frames_per_s, 1e6, "a number of frames per second, such as 30");
  if (raw.pace.empty() ? raw.options.window : raw.pace == "realtime")
    rate.pace = 1.0;
  else if (!raw.pace.empty() && raw.pace != "max")
    rate.pace = parse_positive("--pace", raw.pace, 1e6, "max, realtime or a positive number, such as 0.5");
}

void parse_saves(RawOptions& raw) {
  for (const std::string& text : raw.saves) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
      throw CLI::ValidationError("--save", "'" + text + "' is not REGISTER=FILE, such as A=a.npy");
    raw.options.saved.push_back({text.substr(0, equals), text.substr(equals + 1)});
  }
}

void parse_keys(RawOptions& raw) {
  for (const std::string& text : raw.keys) {
    std::string error;
    const std::optional<KeyPress> press = parse_key_press(text, error);
    if (!press) throw CLI::ValidationError("--keys", error);
    raw.options.keys.push_back(*press);
  }
}

void add_common_options(CLI::App& command, RawOptions& raw, bool takes_program = true) {
  if (takes_program)
    command.add_option("program", raw.options.program, "APRON program")->type_name("FILE")->required();
  command
      .add_option("-I", raw.options.include_paths,
                  "search this directory for included files before the installed library")
      ->type_name("DIR")
      ->allow_extra_args(false);
  command.add_flag("--original", raw.options.original,
                   "the program is one of APRON 2.9: include original.aps before its first line");
  command
      .add_option("--palettes", raw.options.palettes,
                  "file of custom palettes [palettes.txt beside the program, if there is one]")
      ->type_name("FILE");
  command.add_option("--size", raw.size, "array size without a surface [64x64]")->type_name("WxH");
}

void add_execution_options(CLI::App& run, RawOptions& raw) {
  run.add_option("--set", raw.sets, "value of a slider or switch")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  run.add_option(
         "--camera", raw.options.cameras,
         "device [/dev/video0], video, picture or folder of pictures that webcam.open(0) opens; repeat the "
         "option for webcam.open(1) and so on")
      ->type_name("DEVICE|FILE.y4m|PICTURE|FOLDER")
      ->allow_extra_args(false);
  run.add_option("--threads", raw.options.threads,
                 "worker threads for large arrays; results do not depend on it [1]")
      ->type_name("N")
      ->check(whole_number_validator(1, 256));
  run.add_option(
         "--isa", raw.isa,
         "vector instructions: avx512, avx2, or portable, which is what other CPUs use; results do not "
         "depend on it [" +
             std::string(vm::instruction_set_name(vm::best_instruction_set())) + "]")
      ->type_name("NAME");
}

// The second line of --version.
std::string array_code_description() {
  const vm::InstructionSet best = vm::best_instruction_set();
  return best == vm::InstructionSet::kPortable ? "array code: portable; machine code is generated for "
                                                 "AVX-512 and AVX2, which this computer lacks"
                                               : "array code: " + std::string(vm::instruction_set_name(best));
}

void parse_instruction_set(RawOptions& raw) {
  if (raw.isa.empty()) return;
  const std::optional<vm::InstructionSet> isa = vm::find_instruction_set(raw.isa);
  if (!isa) throw CLI::ValidationError("--isa", "'" + raw.isa + "' is not avx512, avx2 or portable");
  if (!vm::is_supported(*isa))
    throw CLI::ValidationError("--isa",
                               "this computer does not have " + raw.isa + "; its best is " +
                                   std::string(vm::instruction_set_name(vm::best_instruction_set())));
  raw.options.isa = *isa;
}

void add_format_options(CLI::App& format, RawOptions& raw) {
  format.add_option("programs", raw.options.files, "APRON programs")->type_name("FILE")->required();
  format.add_flag("--write", raw.options.write, "rewrite the files instead of printing the formatted text");
  format.add_flag("--check", raw.options.check_only,
                  "only list files that need formatting; exit status 1 if there are any");
}

void add_run_options(CLI::App& run, RawOptions& raw) {
  add_common_options(run, raw);
  run.add_option("--shm", raw.options.surface, "connect to the surface with this name and use its size")
      ->type_name("NAME");
  run.add_option("--ticks", raw.options.ticks, "stop after N executions of surface.step or sim.frame")
      ->type_name("N")
      ->check(whole_number_validator(1, std::numeric_limits<std::uint64_t>::max()));
  run.add_option(
         "--pace", raw.pace,
         "without a surface: max, realtime, or program seconds per second [max; realtime with --window]")
      ->type_name("PACE");
  run.add_option("--fps", raw.frames_per_s, "without a surface: frames per second of the program's time [30]")
      ->type_name("N");
  run.add_option("--keys", raw.keys, "key that is down during these frames, for io.key; may be repeated")
      ->type_name("KEY@FIRST[-LAST]")
      ->allow_extra_args(false);
  add_execution_options(run, raw);
  run.add_flag("--timers", raw.options.timers,
               "timers measure wall time, as with --window; by default they read 0");
  run.add_flag("--reconnect", raw.options.reconnect,
               "when the surface is lost, wait for a new one and restart the program");
  run.add_option("--wait", raw.options.wait_s, "how long to wait for the surface to appear [5]")
      ->type_name("SECONDS")
      ->check(seconds_validator());
  run.add_flag("--window", raw.options.window, "open a window with registers, program and controls");
  run.add_flag("--hold", raw.options.hold, "with --window: start paused before the first line");
  run.add_flag("--reset-layout", raw.options.reset_layout, "with --window: forget the sizes of its panes");
  run.add_option("--geometry", raw.geometry,
                 "size of the window or picture, and position of the window ('beside', the default with "
                 "--shm: next to "
                 "the simulator's)")
      ->type_name("WxH[+X+Y]");
  run.add_option("--show", raw.options.show, "register to enlarge at the start")->type_name("REGISTER");
  run.add_option("--screenshot", raw.screenshots,
                 "save a picture of the window after that tick, or at the end")
      ->type_name("FILE.png[@TICK]")
      ->allow_extra_args(false);
  run.add_option("--video", raw.options.video,
                 "record a video of the window, 30 frames per second of the surface's or program's time")
      ->type_name("FILE.mp4");
  run.add_option("--save", raw.saves, "write this register to a .npy, .csv or picture file at the end")
      ->type_name("REGISTER=FILE")
      ->allow_extra_args(false);
  run.add_option("--watch", raw.options.watch,
                 "draw this register while the program runs; if stdout is not a terminal, once at the end")
      ->type_name("REGISTER")
      ->excludes("--window")
      ->excludes("--screenshot")
      ->excludes("--video");
  run.add_option("--profile", raw.options.profile,
                 "write execution counts and times per instruction and line to this file, as JSON")
      ->type_name("FILE");
  run.add_option("--cost-model", raw.options.cost_model,
                 "with --profile: add the estimated cost on the processor array that this file describes")
      ->type_name("FILE");
}

void add_import_options(CLI::App& import, RawOptions& raw) {
  import.add_option("kernel", raw.options.program, "SCAMP-5 kernels in C++, or a list of instructions")
      ->type_name("FILE")
      ->required();
  import
      .add_option("--output", raw.options.output, "write the program to this file instead of standard output")
      ->type_name("FILE.aps");
  import.add_option("--picture", raw.options.picture, "picture that the imported program takes as its light")
      ->type_name("FILE");
}

void parse_geometry(RawOptions& raw) {
  WindowGeometry& geometry = raw.options.geometry;
  if (raw.geometry.empty()) {
    geometry.beside_simulator = raw.options.window && !raw.options.surface.empty();
    return;
  }
  if (raw.geometry == "beside") {
    geometry.beside_simulator = true;
    return;
  }
  std::string_view rest = raw.geometry;
  const auto number = [&](char before, int& value) {
    if (before != '\0') {
      if (rest.empty() || rest.front() != before) return false;
      rest.remove_prefix(1);
    }
    const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
    rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
    return error == std::errc{} && value >= 0 && value <= 8192;
  };
  int x = 0, y = 0;
  bool valid = number('\0', geometry.width) && number('x', geometry.height) && geometry.width >= 320 &&
               geometry.height >= 240;
  if (valid && !rest.empty()) {
    valid = number('+', x) && number('+', y) && rest.empty();
    geometry.position = {x, y};
  }
  if (!valid)
    throw CLI::ValidationError("--geometry",
                               "'" + raw.geometry +
                                   "' is not WIDTHxHEIGHT or WIDTHxHEIGHT+X+Y in pixels, such as "
                                   "1280x800+600+0, from 320x240 to 8192x8192");
}

void parse_screenshot(RawOptions& raw, const std::string& text) {
  Screenshot screenshot{text, std::nullopt};
  if (const std::size_t at = text.rfind('@'); at != std::string::npos) {
    std::uint64_t tick = 0;
    if (!parse_number(std::string_view(text).substr(at + 1), tick))
      throw CLI::ValidationError("--screenshot",
                                 "'" + text + "' is not FILE.png or FILE.png@TICK with a whole number");
    screenshot = {text.substr(0, at), tick};
  }
  if (!std::string_view(screenshot.file).ends_with(".png"))
    throw CLI::ValidationError("--screenshot", "'" + screenshot.file + "': the file name must end in .png");
  raw.options.screenshots.push_back(std::move(screenshot));
}

void validate_ui_options(RawOptions& raw) {
  const Options& options = raw.options;
  parse_geometry(raw);
  for (const std::string& text : raw.screenshots) parse_screenshot(raw, text);
  if (options.window && (!options.screenshots.empty() || !options.video.empty()))
    throw CLI::ValidationError("--window",
                               "cannot be combined with --screenshot or --video, which need no display");
  if (options.window && options.reconnect)
    throw CLI::ValidationError("--window", "cannot be combined with --reconnect");
  if (options.hold && !options.window) throw CLI::ValidationError("--hold", "requires --window");
  if (options.reset_layout && !options.window)
    throw CLI::ValidationError("--reset-layout", "requires --window");
  if (!options.uses_ui() && (!raw.geometry.empty() || !options.show.empty()))
    throw CLI::ValidationError(raw.geometry.empty() ? "--show" : "--geometry",
                               "requires --window, --screenshot or --video");
}

void validate_run_options(RawOptions& raw) {
  parse_instruction_set(raw);
  validate_ui_options(raw);
  if (!raw.options.cost_model.empty() && raw.options.profile.empty())
    throw CLI::ValidationError("--cost-model", "requires --profile FILE, which receives the estimate");
  if (!raw.size.empty() && !raw.options.surface.empty())
    throw CLI::ValidationError("--size",
                               "cannot be combined with --shm: the program uses the size of the surface");
  for (const std::string& set : raw.sets) parse_parameter(raw, set);
  // The simulator passes its surface's name to the controllers that it starts.
  const char* environment_name = std::getenv("SMARTSURF_SHM");
  if (raw.options.surface.empty() && raw.size.empty() && environment_name != nullptr)
    raw.options.surface = environment_name;
  parse_frame_rate(raw);
  parse_keys(raw);
  parse_saves(raw);
}

}  // namespace

ParsedOptions parse_options(int argc, char** argv) {
  CLI::App app("APRON: runs array-processing programs, stand-alone or on a smart surface", "apron");
  app.set_version_flag("--version", "apron " SMARTSURF_VERSION "\n" + array_code_description());
  app.require_subcommand(1);
  app.footer(kFooter);
  RawOptions raw;
  CLI::App& run = *app.add_subcommand("run", "run a program");
  add_run_options(run, raw);
  CLI::App& check = *app.add_subcommand("check", "check a program for errors");
  add_common_options(check, raw);
  check.add_flag("--local", raw.options.local_check,
                 "also report instructions that a purely local array cannot execute");
  check.add_option("--profile", raw.profile)->group("");  // alias of --local
  CLI::App& disassemble = *app.add_subcommand("disasm", "list a program's instructions");
  add_common_options(disassemble, raw);
  CLI::App& format = *app.add_subcommand("fmt", "format programs");
  add_format_options(format, raw);
  CLI::App& import = *app.add_subcommand("import", "translate SCAMP-5 kernels into a program");
  add_import_options(import, raw);
  CLI::App& repl = *app.add_subcommand("repl", "run a program interactively, line by line");
  add_common_options(repl, raw, false);
  add_execution_options(repl, raw);
  try {
    app.parse(argc, argv);
    if (!raw.size.empty()) parse_size(raw);
    if (run.parsed()) validate_run_options(raw);
    if (check.parsed() && !raw.profile.empty() && raw.profile != "local")
      throw CLI::ValidationError("--profile", "'" + raw.profile + "' is unknown; known: local");
    raw.options.local_check |= check.parsed() && !raw.profile.empty();
    raw.options.subcommand = run.parsed()      ? Subcommand::kRun
                             : check.parsed()  ? Subcommand::kCheck
                             : format.parsed() ? Subcommand::kFormat
                             : repl.parsed()   ? Subcommand::kRepl
                             : import.parsed() ? Subcommand::kImport
                                               : Subcommand::kDisassemble;
    if (repl.parsed()) {
      parse_instruction_set(raw);
      for (const std::string& set : raw.sets) parse_parameter(raw, set);
    }
    return {raw.options, std::nullopt};
  } catch (const CLI::Success& success) {
    return {raw.options, app.exit(success)};
  } catch (const CLI::ParseError& error) {
    std::cerr << "apron: error: " << common::describe_parse_error(app, error, argc, argv) << '\n';
    return {raw.options, common::kUserError};
  }
}

}  // namespace apron::run
