#include "apron/run/options/Options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "apron/program/Program.h"
#include "common/cli/ParseErrors.h"
#include "common/text/Number.h"
#include "common/text/Printable.h"

namespace apron::run {
namespace {

constexpr const char* kFooter =
    "Exit status: 0 success, also when the surface ends the session; 1 run-time error; 2 invalid input\n"
    "(command line, program, file, channel); 3 surface lost; 128 + n after signal n (130 after Ctrl-C),\n"
    "cleanly detached. Files that a program opens or saves are relative to the current directory.";

template <class... Arguments>
[[noreturn]] void refuse(const std::string& option, fmt::format_string<Arguments...> reason,
                         Arguments&&... arguments) {
  throw CLI::ValidationError(option, fmt::format(reason, std::forward<Arguments>(arguments)...));
}

CLI::Validator whole_number_validator(std::uint64_t min_value, std::uint64_t max_value) {
  return {[=](std::string& text) {
            std::uint64_t value = 0;
            if (common::parse_number(text, value) && value >= min_value && value <= max_value)
              return std::string();
            return fmt::format("'{}' is not a whole number from {} to {}", text, min_value, max_value);
          },
          ""};
}

CLI::Validator seconds_validator() {
  return {[](std::string& text) {
            double value = 0;
            if (common::parse_number(text, value) && value >= 0.0 && value <= 1e6) return std::string();
            return "'" + text + "' is not a time in seconds from 0 to 1000000";
          },
          ""};
}

// An option with a value, and one that may be repeated, each with one value.
template <class Target>
CLI::Option* add_value(CLI::App& command, const std::string& name, Target& target, const std::string& type,
                       const std::string& help) {
  return command.add_option(name, target, help)->type_name(type);
}
template <class Target>
void add_repeated(CLI::App& command, const std::string& name, Target& target, const std::string& type,
                  const std::string& help) {
  add_value(command, name, target, type, help)->allow_extra_args(false);
}

// Options as typed by the user, before validation.
struct RawOptions {
  Options options;
  std::string size, profile, show_registers, isa, pace, frames_per_s;
  std::string target, tile, link, rate, turnaround, channels;
  std::vector<std::string> sets, keys, saves;
  std::string geometry;
  bool uses_standard_streams = true;
  std::vector<std::string> screenshots;
};

void parse_size(RawOptions& raw) {
  const std::size_t x = raw.size.find('x');
  Options& options = raw.options;
  const std::string_view text = raw.size;
  const bool valid = x != std::string::npos && common::parse_number(text.substr(0, x), options.width) &&
                     common::parse_number(text.substr(x + 1), options.height) && options.width > 0 &&
                     options.height > 0 && std::size_t{options.width} * options.height <= program::kMaxCells;
  if (!valid)
    refuse("--size", "'{}' is not WIDTHxHEIGHT, such as 64x64, of at most {} cells", raw.size,
           program::kMaxCells);
}

// "1M", "250k" or "9600".
double parse_baud(const std::string& text) {
  double unit = 1.0;
  std::string_view number = text;
  if (!number.empty() && (number.back() == 'M' || number.back() == 'k')) {
    unit = number.back() == 'M' ? 1e6 : 1e3;
    number.remove_suffix(1);
  }
  double value = 0;
  if (common::parse_number(number, value) && value > 0.0 && value * unit <= 1e12) return value * unit;
  refuse("--link", "'{}' is not a number of baud, such as 115200, 250k or 4M", text);
}

void parse_parameter(RawOptions& raw, const std::string& text) {
  const std::size_t equals = text.find('=');
  float value = 0;
  if (equals == std::string::npos || equals == 0 ||
      !common::parse_number(std::string_view(text).substr(equals + 1), value) || !std::isfinite(value))
    refuse("--set", "'{}' is not NAME=VALUE with a number, such as speed=0.5", text);
  raw.options.parameters[text.substr(0, equals)] = value;
}

double parse_positive(const std::string& option, const std::string& text, double max_value,
                      const std::string& expected) {
  double value = 0;
  if (common::parse_number(text, value) && value > 0.0 && value <= max_value) return value;
  refuse(option, "'{}' is not {}", text, expected);
}

void parse_frame_rate(RawOptions& raw) {
  FrameRate& rate = raw.options.frame_rate;
  if (!raw.options.surface.empty()) {
    if (!raw.pace.empty() || !raw.frames_per_s.empty())
      refuse(raw.pace.empty() ? "--fps" : "--pace",
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
      refuse("--save", "'{}' is not REGISTER=FILE, such as A=a.npy", text);
    raw.options.saved.push_back({text.substr(0, equals), text.substr(equals + 1)});
  }
}

void parse_shown_registers(RawOptions& raw) {
  const std::string& text = raw.show_registers;
  if (text.empty()) return;
  const std::size_t colon = std::min(text.find(':'), text.size());
  int& descriptor = raw.options.shown_descriptor;
  if (!common::parse_number(std::string_view(text).substr(0, colon), descriptor) || descriptor < 0 ||
      colon + 1 >= text.size())
    refuse("--show-registers",
           "'{}' is not DESCRIPTOR:NAMES[:DRAWN]; smartsurf run --record-registers passes it", text);
  const std::size_t second = std::min(text.find(':', colon + 1), text.size());
  raw.options.shown_registers = text.substr(colon + 1, second - colon - 1);
  if (second < text.size()) raw.options.drawn_register = text.substr(second + 1);
}

void parse_keys(RawOptions& raw) {
  for (const std::string& text : raw.keys) {
    std::string error;
    const std::optional<KeyPress> press = parse_key_press(text, error);
    if (!press) refuse("--keys", "{}", error);
    raw.options.keys.push_back(*press);
  }
}

void add_common_options(CLI::App& command, RawOptions& raw, bool takes_program = true) {
  if (takes_program) add_value(command, "program", raw.options.program, "FILE", "APRON program")->required();
  add_repeated(command, "-I", raw.options.include_paths, "DIR",
               "search this directory for included files before the installed library");
  command
      .add_flag("--original{original}", raw.options.original,
                "the program is one of APRON 2.9: include original.aps, or with --original=scamp5c "
                "scamp5c.aps, before its first line")
      ->check(CLI::IsMember({"original", "scamp5c"}));
  add_value(command, "--palettes", raw.options.palettes, "FILE",
            "file of custom palettes [palettes.txt beside the program, if there is one]");
  add_value(command, "--size", raw.size, "WxH", "array size without a surface [64x64]");
}

void add_execution_options(CLI::App& run, RawOptions& raw) {
  add_repeated(run, "--set", raw.sets, "NAME=VALUE", "value of a slider or switch");
  add_repeated(run, "--camera", raw.options.cameras, "DEVICE|FILE.y4m|PICTURE|FOLDER",
               "device [/dev/video0], video, picture or folder of pictures that webcam.open(0) opens; repeat "
               "the option for webcam.open(1) and so on");
  add_repeated(run, "--module", raw.options.modules, "NAME",
               "let the program load this native module, which it names with !module");
  add_value(run, "--threads", raw.options.threads, "N",
            "worker threads for large arrays; results do not depend on it [1]")
      ->check(whole_number_validator(1, 256));
  add_value(run, "--isa", raw.isa, "NAME",
            "vector instructions: avx512, avx2, or portable, which is what other CPUs use; results do not "
            "depend on it [" +
                std::string(vm::instruction_set_name(vm::best_instruction_set())) + "]");
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
  if (!isa) refuse("--isa", "'{}' is not avx512, avx2 or portable", raw.isa);
  if (!vm::is_supported(*isa))
    refuse("--isa", "this computer does not have {}; its best is {}", raw.isa,
           vm::instruction_set_name(vm::best_instruction_set()));
  raw.options.isa = *isa;
}

void add_format_options(CLI::App& format, RawOptions& raw) {
  add_value(format, "programs", raw.options.files, "FILE", "APRON programs")->required();
  format.add_flag("--write", raw.options.write, "rewrite the files instead of printing the formatted text");
  format.add_flag("--check", raw.options.check_only,
                  "only list files that need formatting; exit status 1 if there are any");
}

void add_run_options(CLI::App& run, RawOptions& raw) {
  add_common_options(run, raw);
  add_value(run, "--shm", raw.options.surface, "NAME",
            "connect to the surface with this name and use its size");
  add_value(run, "--ticks", raw.options.ticks, "N", "stop after N executions of surface.step or sim.frame")
      ->check(whole_number_validator(1, std::numeric_limits<std::uint64_t>::max()));
  add_value(run, "--pace", raw.pace, "PACE",
            "without a surface: max, realtime, or program seconds per second [max; realtime with --window]");
  add_value(run, "--fps", raw.frames_per_s, "N",
            "without a surface: frames per second of the program's time [30]");
  add_repeated(run, "--keys", raw.keys, "KEY@FIRST[-LAST]",
               "key that is down during these frames, for io.key; may be repeated");
  add_execution_options(run, raw);
  add_repeated(run, "--allow", raw.options.allowed_folders, "FOLDER",
               "let the program read and write files there too, not only in its own folder");
  run.add_flag("--timers", raw.options.timers,
               "timers measure wall time, as with --window; by default they read 0");
  run.add_flag("--reconnect", raw.options.reconnect,
               "when the surface is lost, wait for a new one and restart the program");
  add_value(run, "--wait", raw.options.wait_s, "SECONDS", "how long to wait for the surface to appear [5]")
      ->check(seconds_validator());
  run.add_flag("--window", raw.options.window, "open a window with registers, program and controls");
  run.add_flag("--hold", raw.options.hold, "with --window: start paused before the first line");
  run.add_flag("--reset-layout", raw.options.reset_layout, "with --window: forget the sizes of its panes");
  add_value(run, "--geometry", raw.geometry, "WxH[+X+Y]",
            "size of the window or picture, and position of the window ('beside', the default with --shm: "
            "next to the simulator's)");
  add_value(run, "--show", raw.options.show, "REGISTER", "register to enlarge at the start");
  add_repeated(run, "--screenshot", raw.screenshots, "FILE.png[@TICK]",
               "save a picture of the window after that tick, or at the end");
  add_value(run, "--video", raw.options.video, "FILE.mp4",
            "record a video of the window, 30 frames per second of the surface's or program's time");
  add_repeated(run, "--save", raw.saves, "REGISTER=FILE",
               "write this register to a .npy, .csv or picture file at the end");
  add_value(run, "--show-registers", raw.show_registers, "DESCRIPTOR:NAMES", "")->group("");
  add_value(run, "--watch", raw.options.watch, "REGISTER",
            "draw this register while the program runs; if stdout is not a terminal, once at the end")
      ->excludes("--window")
      ->excludes("--screenshot")
      ->excludes("--video");
  add_value(run, "--profile", raw.options.profile, "FILE",
            "write execution counts and processor time per instruction and line to this file, as JSON");
  add_value(run, "--cost-model", raw.options.cost_model, "FILE",
            "with --profile: add the estimated cost on the processor array that this file describes");
}

void add_import_options(CLI::App& import, RawOptions& raw) {
  add_value(import, "kernel", raw.options.program, "FILE",
            "SCAMP-5 kernels in C++, or a list of instructions")
      ->required();
  add_value(import, "--output", raw.options.output, "FILE.aps",
            "write the program to this file instead of standard output");
  add_value(import, "--picture", raw.options.picture, "FILE",
            "picture that the imported program takes as its light");
}

void add_compile_options(CLI::App& compile, RawOptions& raw) {
  add_common_options(compile, raw);
  add_value(compile, "--target", raw.target, "NAME", "what the boards compile: c")->required();
  add_value(compile, "-o", raw.options.output, "FILE.c", "write the C there, and its header beside it")
      ->required();
  add_value(compile, "--tile", raw.tile, "WxH", "columns and rows of one board [the whole table, --size]");
  add_value(compile, "--halo", raw.options.halo, "N",
            "cells that one exchange brings from each neighbour [1]")
      ->check(whole_number_validator(1, 16));
  add_value(compile, "--name", raw.options.name, "NAME", "prefix of the names in the C [from FILE]");
  add_value(compile, "--channels", raw.channels, "NAME,...",
            "channels that the surface has [those that the program senses or actuates]");
  add_repeated(compile, "--set", raw.sets, "NAME=VALUE", "value of a slider or switch");
  add_value(compile, "--unroll", raw.options.unroll, "N",
            "instructions after which a loop is a loop of the C as well; results do not depend on it [20000]")
      ->check(whole_number_validator(1, 1000000));
  add_value(compile, "--link", raw.link, "BAUD",
            "refuse the program if its edges take longer than a tick over such a serial link to each "
            "neighbour, such as 4M");
  add_value(compile, "--rate", raw.rate, "HZ", "with --link: ticks per second [60]");
  add_value(compile, "--turnaround", raw.turnaround, "MICROSECONDS",
            "with --link: from the end of a message to the start of the answer [20]");
}

void parse_compile_options(RawOptions& raw) {
  Options& options = raw.options;
  if (raw.target != "c") refuse("--target", "'{}' is unknown; known: c", raw.target);
  if (options.output.size() < 3 || !options.output.ends_with(".c"))
    refuse("-o", "'{}' does not end in .c", options.output);
  const std::string_view file = std::string_view(options.output).substr(options.output.find_last_of('/') + 1);
  if (file.find("??") != std::string_view::npos || std::ranges::any_of(file, [](unsigned char c) {
        return c < 0x20 || c == 0x7F || c == '"' || c == '\\';
      }))
    refuse("-o", "'{}': C cannot include its header: a file name without \", \\ and ??", options.output);
  options.tile_width = options.width;
  options.tile_height = options.height;
  if (!raw.tile.empty()) {
    const std::size_t x = raw.tile.find('x');
    const std::string_view text = raw.tile;
    if (x == std::string::npos || !common::parse_number(text.substr(0, x), options.tile_width) ||
        !common::parse_number(text.substr(x + 1), options.tile_height) || options.tile_width == 0 ||
        options.tile_height == 0 || options.tile_width > options.width ||
        options.tile_height > options.height)
      refuse("--tile", "'{}' is not WIDTHxHEIGHT, such as 8x8, of at most the table's {}x{}", raw.tile,
             options.width, options.height);
  }
  if (!raw.channels.empty()) {
    options.channels.emplace();
    for (std::size_t begin = 0; begin <= raw.channels.size();) {
      const std::size_t end = std::min(raw.channels.find(',', begin), raw.channels.size());
      options.channels->push_back(raw.channels.substr(begin, end - begin));
      begin = end + 1;
    }
  }
  if (!raw.link.empty()) options.link_baud = parse_baud(raw.link);
  if (raw.link.empty() && (!raw.rate.empty() || !raw.turnaround.empty()))
    refuse(raw.rate.empty() ? "--turnaround" : "--rate", "requires --link");
  if (!raw.rate.empty())
    options.rate_hz = parse_positive("--rate", raw.rate, 1e6, "a number of ticks per second, such as 60");
  if (!raw.turnaround.empty())
    options.turnaround_s =
        1e-6 * parse_positive("--turnaround", raw.turnaround, 1e9, "a time in microseconds, such as 20");
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  if (options.name.empty()) {
    for (const char c : file)
      if (c == '.')
        break;
      else
        options.name += is_letter(c) || is_digit(c) ? c : '_';
    if (!options.name.empty() && is_digit(options.name.front())) options.name.insert(0, 1, '_');
  }
  const bool is_identifier =
      !options.name.empty() && is_letter(options.name.front()) &&
      std::ranges::all_of(options.name, [&](char c) { return is_letter(c) || is_digit(c); });
  if (!is_identifier)
    refuse("--name", "'{}' is not a C identifier of ASCII letters, digits and _", options.name);
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
    rest.remove_prefix(end - rest.data());
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
    refuse("--geometry",
           "'{}' is not WIDTHxHEIGHT or WIDTHxHEIGHT+X+Y in pixels, such as 1280x800+600+0, from 320x240 to "
           "8192x8192",
           raw.geometry);
}

void parse_screenshot(RawOptions& raw, const std::string& text) {
  Screenshot screenshot{text, std::nullopt};
  if (const std::size_t at = text.rfind('@'); at != std::string::npos) {
    std::uint64_t tick = 0;
    if (!common::parse_number(std::string_view(text).substr(at + 1), tick))
      refuse("--screenshot", "'{}' is not FILE.png or FILE.png@TICK with a whole number", text);
    screenshot = {text.substr(0, at), tick};
  }
  if (!std::string_view(screenshot.file).ends_with(".png"))
    refuse("--screenshot", "'{}': the file name must end in .png", screenshot.file);
  raw.options.screenshots.push_back(std::move(screenshot));
}

void validate_ui_options(RawOptions& raw) {
  const Options& options = raw.options;
  parse_geometry(raw);
  for (const std::string& text : raw.screenshots) parse_screenshot(raw, text);
  if (options.window && (!options.screenshots.empty() || !options.video.empty()))
    refuse("--window", "cannot be combined with --screenshot or --video, which need no display");
  for (const Screenshot& screenshot : options.screenshots)
    if (screenshot.tick && options.ticks && *screenshot.tick > *options.ticks)
      refuse("--screenshot", "'{}@{}': the run ends before, --ticks {}", screenshot.file, *screenshot.tick,
             *options.ticks);
  const WindowGeometry& size = options.geometry;
  if (!options.video.empty() && (size.width % 2 != 0 || size.height % 2 != 0))
    refuse("--geometry", "'{}': a video needs even numbers", raw.geometry);
  if (options.window && options.reconnect) refuse("--window", "cannot be combined with --reconnect");
  if (options.hold && !options.window) refuse("--hold", "requires --window");
  if (options.reset_layout && !options.window) refuse("--reset-layout", "requires --window");
  if (!options.uses_ui() && (!raw.geometry.empty() || !options.show.empty()))
    refuse(raw.geometry.empty() ? "--show" : "--geometry", "requires --window, --screenshot or --video");
}

void validate_run_options(RawOptions& raw) {
  parse_instruction_set(raw);
  validate_ui_options(raw);
  if (!raw.options.cost_model.empty() && raw.options.profile.empty())
    refuse("--cost-model", "requires --profile FILE, which receives the estimate");
  if (!raw.size.empty() && !raw.options.surface.empty())
    refuse("--size", "cannot be combined with --shm: the program uses the size of the surface");
  for (const std::string& set : raw.sets) parse_parameter(raw, set);
  // The simulator passes its surface's name to the controllers that it starts.
  const char* environment_name = std::getenv("SMARTSURF_SHM");
  if (raw.options.surface.empty() && raw.size.empty() && environment_name != nullptr)
    raw.options.surface = environment_name;
  parse_frame_rate(raw);
  parse_shown_registers(raw);
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
  disassemble.set_version_flag("--instructions", program::instruction_table,
                               "list the machine's instructions, with operands and reach, and exit");
  CLI::App& format = *app.add_subcommand("fmt", "format programs");
  add_format_options(format, raw);
  CLI::App& import = *app.add_subcommand("import", "translate SCAMP-5 kernels into a program");
  add_import_options(import, raw);
  CLI::App& compile =
      *app.add_subcommand("compile", "translate a local program to C for the boards of a table");
  add_compile_options(compile, raw);
  CLI::App& repl = *app.add_subcommand("repl", "run a program interactively, line by line");
  add_common_options(repl, raw, false);
  add_execution_options(repl, raw);
  CLI::App& debug = *app.add_subcommand("debug", "debug a program by commands from standard input");
  add_common_options(debug, raw);
  add_execution_options(debug, raw);
  add_repeated(debug, "--allow", raw.options.allowed_folders, "FOLDER",
               "let the program read and write files there too, not only in its own folder");
  CLI::App& server =
      *app.add_subcommand("lsp", "serve editors by the Language Server Protocol on standard input");
  add_repeated(server, "-I", raw.options.include_paths, "DIR",
               "search this directory for included files before the installed library");
  add_value(server, "--size", raw.size, "WxH", "size of the surface for which programs are compiled [64x64]");
  server.add_flag("--stdio", raw.uses_standard_streams, "the default; for editors that say so");
  try {
    common::refuse_empty_values(app);
    app.parse(argc, argv);
    if (!raw.size.empty()) parse_size(raw);
    if (run.parsed()) validate_run_options(raw);
    if (check.parsed() && !raw.profile.empty() && raw.profile != "local")
      refuse("--profile", "'{}' is unknown; known: local", raw.profile);
    raw.options.local_check |= check.parsed() && !raw.profile.empty();
    raw.options.subcommand = run.parsed()       ? Subcommand::kRun
                             : check.parsed()   ? Subcommand::kCheck
                             : format.parsed()  ? Subcommand::kFormat
                             : repl.parsed()    ? Subcommand::kRepl
                             : import.parsed()  ? Subcommand::kImport
                             : compile.parsed() ? Subcommand::kCompile
                             : debug.parsed()   ? Subcommand::kDebug
                             : server.parsed()  ? Subcommand::kLanguageServer
                                                : Subcommand::kDisassemble;
    if (compile.parsed()) {
      parse_compile_options(raw);
      for (const std::string& set : raw.sets) parse_parameter(raw, set);
    }
    if (repl.parsed() || debug.parsed()) {
      parse_instruction_set(raw);
      for (const std::string& set : raw.sets) parse_parameter(raw, set);
    }
    return {raw.options, std::nullopt};
  } catch (const CLI::Success& success) {
    return {raw.options, app.exit(success)};
  } catch (const CLI::ParseError& error) {
    common::print_error_line("apron: error", common::describe_parse_error(app, error, argc, argv));
    return {raw.options, common::kUserError};
  }
}

}  // namespace apron::run
