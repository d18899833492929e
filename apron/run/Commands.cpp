#include "apron/run/Commands.h"

#include <shm_protocol/ControllerEndpoint.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <new>

#include "apron/program/LocalityCheck.h"
#include "apron/run/DrawnRun.h"
#include "apron/run/ProfileFile.h"
#include "apron/run/ProgramFile.h"
#include "apron/run/StopSignal.h"
#include "apron/run/SurfaceHost.h"
#include "apron/run/Watch.h"
#include "apron/vm/Vm.h"

namespace apron::run {
namespace {

int complain(int status, const std::string& text) {
  std::fflush(stdout);
  std::cerr << "apron: " << text << '\n';
  return status;
}

// "" if every --set names a slider or switch of the program.
std::string unknown_parameter(const Options& options, const program::Program& program) {
  for (const auto& parameter : options.parameters) {
    const std::string& name = parameter.first;
    const auto named = [&](const program::Parameter& p) { return p.name == name; };
    if (std::any_of(program.parameters.begin(), program.parameters.end(), named)) continue;
    std::string there;
    for (const program::Parameter& p : program.parameters) there += (there.empty() ? "" : ", ") + p.name;
    return "error: --set: the program has no slider or switch '" + name + "'; it has " +
           (there.empty() ? "none" : there);
  }
  return {};
}

// Instructions between two looks at a register; more than any segment has.
constexpr std::uint64_t kLookEvery = 8192;

vm::Status run_to_end(vm::Vm& vm, const Options& options, std::uint64_t& ticks) {
  std::optional<Watch> watch;
  if (!options.watch.empty()) {
    watch.emplace(vm, options.watch);
    watch->look();  // the screen is ready before anything is printed
  }
  while (!options.ticks || ticks < *options.ticks) {
    const vm::Status status = watch ? vm.run(kLookEvery) : vm.run();
    if (watch) watch->look();
    if (status == vm::Status::kTick)
      ++ticks;
    else if (status != vm::Status::kRunning)
      return status;
  }
  return vm::Status::kEnded;
}

// "" if the file can be written, as far as can be told before.
std::string unwritable(const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path folder = fs::absolute(file, ignored).parent_path();
  if (fs::is_directory(file, ignored)) return "it is a folder";
  if (!fs::is_directory(folder, ignored)) return "there is no folder " + folder.string();
  return {};
}

bool write_profile(const program::Program& program, const std::vector<vm::InstructionProfile>& spent,
                   std::uint64_t ticks, const std::optional<CostModel>& model, const Options& options) {
  errno = 0;
  std::ofstream file(options.profile);
  file << profile_json(program, spent, ticks, model) << std::flush;
  if (!file) complain(kRunFailed, "error: cannot write '" + options.profile + "': " + std::strerror(errno));
  return static_cast<bool>(file);
}

int exit_status(vm::Status status, const std::string& error, const Options& options) {
  if (std::fflush(stdout) != 0 && status == vm::Status::kEnded)
    return complain(kRunFailed, "error: cannot write the program's output");
  switch (status) {
    case vm::Status::kRunning:
    case vm::Status::kTick:
    case vm::Status::kEnded:
    case vm::Status::kClosed:
      return kDone;
    case vm::Status::kPeerLost:
      return complain(kPeerLost, "the surface '" + options.surface + "' was lost");
    case vm::Status::kInterrupted:
      return kSignalled + stop_signal();
    case vm::Status::kRefused:
    case vm::Status::kFailed:
      break;
  }
  std::cerr << error << '\n';
  return status == vm::Status::kRefused ? kWrongInput : kRunFailed;
}

// What came of a run, with a window or without.
struct Ran {
  vm::Status status = vm::Status::kEnded;
  std::string error;
  std::uint64_t ticks = 0;
  std::vector<vm::InstructionProfile> spent;
};

Ran run_plainly(const Options& options, program::Program program, LocalHost& host) {
  vm::VmOptions how;
  how.threads = options.threads;
  how.stop = &stop_flag();
  how.enable_profiling = !options.profile.empty();
  how.fusion.preserve_named_registers = !options.watch.empty();  // else nobody looks at them but the program
  vm::Vm vm(std::move(program), how, host);
  Ran ran;
  ran.status = run_to_end(vm, options, ran.ticks);
  ran.error = vm.error();
  ran.spent = vm.profile();
  return ran;
}

using OnHold = std::function<void(bool)>;

// Compiles for the array's size and runs on the host that with_host() gives.
template <class WithHost>
int run_on(const Options& options, std::uint32_t width, std::uint32_t height, const WithHost& with_host) {
  std::string wrong_program;
  const std::optional<Compiled> compiled = compile_texts(options, width, height, wrong_program);
  std::cerr << wrong_program;
  if (!compiled) return kWrongInput;
  const program::Program& program = compiled->program;
  if (const std::string unknown = unknown_parameter(options, program); !unknown.empty())
    return complain(kWrongInput, unknown);
  if (const std::string unknown = options.watch.empty() ? "" : Watch::unknown(program, options.watch);
      !unknown.empty())
    return complain(kWrongInput, "error: " + unknown);
  std::optional<CostModel> model;
  if (std::string wrong; !options.cost_model.empty()) {
    model = read_cost_model(options.cost_model, wrong);
    if (!model) {
      std::cerr << wrong << '\n';
      return kWrongInput;
    }
  }
  return with_host([&](LocalHost& host, const OnHold& on_hold) {
    if (const std::string wrong = host.load_modules(program.modules, module_paths(options)); !wrong.empty())
      return complain(kWrongInput, "error: " + wrong);
    Ran ran;
    if (options.draws()) {
      DrawnOutcome drawn = run_drawn({options, *compiled, width, height, host, on_hold});
      if (!drawn.wrong.empty()) return complain(kWrongInput, "error: " + drawn.wrong);
      ran = {drawn.status, std::move(drawn.error), drawn.ticks, std::move(drawn.spent)};
    } else {
      ran = run_plainly(options, program, host);
    }
    const int exit = exit_status(ran.status, ran.error, options);
    const bool written =
        options.profile.empty() || write_profile(program, ran.spent, ran.ticks, model, options);
    return written ? exit : std::max<int>(exit, kRunFailed);
  });
}

const std::atomic<bool>& end_of_waits(const Options& options) {
  return options.draws() ? interrupt_flag() : stop_flag();
}

Surroundings surroundings(const Options& options) {
  const bool clocked = options.timers || options.window;
  return {options.cameras, clocked ? Timers::Clock(wall_clock_s) : Timers::Clock()};
}

int run_alone(const Options& options) {
  return run_on(options, options.width, options.height, [&](const auto& go) {
    LocalHost host(options.parameters, end_of_waits(options), surroundings(options));
    return go(host, {});
  });
}

// One session with a surface: from attaching to it to its end or ours.
int run_session(const Options& options, std::chrono::nanoseconds wait) {
  using shm_protocol::ControllerEndpoint;
  ControllerEndpoint surface =
      ControllerEndpoint::attach(options.surface, {.timeout = wait, .stop = &stop_flag()});
  const shm_protocol::Description& size = surface.description();
  return run_on(options, size.columns, size.rows, [&](const auto& go) {
    SurfaceHost host(surface, end_of_waits(options), options.parameters, surroundings(options));
    switch (host.begin()) {
      case vm::HostStatus::kOk:
        return go(host, [&host](bool held) { host.show_paused(held); });
      case vm::HostStatus::kClosed:
        return static_cast<int>(kDone);
      case vm::HostStatus::kInterrupted:
        return exit_status(vm::Status::kInterrupted, "", options);
      case vm::HostStatus::kPeerLost:
        return exit_status(vm::Status::kPeerLost, "", options);
      default:
        return complain(kRunFailed, "error: " + host.message());
    }
  });
}

int attach_failed(const shm_protocol::Error& error) {
  using shm_protocol::ErrorCode;
  if (error.code() == ErrorCode::kInterrupted) return kSignalled + stop_signal();
  return complain(error.code() == ErrorCode::kSystem ? kRunFailed : kWrongInput,
                  std::string("error: ") + error.what());
}

int run_on_surface(const Options& options) {
  constexpr std::chrono::hours kLong{24 * 365};
  std::chrono::nanoseconds wait =
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(options.wait_s));
  for (;;) {
    const int status = run_session(options, wait);
    if (status != kPeerLost || !options.reconnect) return status;
    std::cerr << "apron: waiting for a new surface '" << options.surface << "'\n";
    wait = kLong;
  }
}

}  // namespace

int run_program(const Options& options) {
  catch_stop_signals();
  if (const std::string why = options.profile.empty() ? "" : unwritable(options.profile); !why.empty())
    return complain(kWrongInput, "error: --profile " + options.profile + ": " + why);
  if (options.draws())
    if (const std::string why = drawing_unavailable(options); !why.empty())
      return complain(kWrongInput, "error: " + why);
  try {
    return options.surface.empty() ? run_alone(options) : run_on_surface(options);
  } catch (const shm_protocol::Error& error) {
    return attach_failed(error);
  } catch (const std::bad_alloc&) {
    return complain(kRunFailed, "error: there is not enough memory for the program's registers");
  }
}

int check_program(const Options& options) {
  const std::optional<program::Program> program = compile_file(options, options.width, options.height);
  if (!program) return kWrongInput;
  if (!options.local_profile) return kDone;
  const std::vector<program::NonLocalInstruction> beyond = program::find_nonlocal_instructions(*program);
  for (const program::NonLocalInstruction& n : beyond) {
    const program::SourceLocation& source =
        program->source_locations[program->code[n.instruction].source_location];
    std::cout << program->files[source.file] << ':' << source.line << ": not local: " << n.reason << '\n';
  }
  if (!beyond.empty()) return kRunFailed;
  std::cout << options.program << ": every instruction is local\n";
  return kDone;
}

int disassemble_program(const Options& options) {
  const std::optional<program::Program> program = compile_file(options, options.width, options.height);
  if (!program) return kWrongInput;
  std::cout << program::disassemble(*program);
  return kDone;
}

}  // namespace apron::run
