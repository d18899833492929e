#include "apron/run/cli/Commands.h"

#include <shm_protocol/ControllerEndpoint.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <new>

#include "apron/program/CallSite.h"
#include "apron/program/LocalityCheck.h"
#include "apron/program/Reachability.h"
#include "apron/run/cli/ConfinedProgram.h"
#include "apron/run/cli/ProfileReport.h"
#include "apron/run/cli/TerminalMonitor.h"
#include "apron/run/host/RegisterView.h"
#include "apron/run/host/SurfaceHost.h"
#include "apron/run/media/CameraSources.h"
#include "apron/run/options/CompiledProgram.h"
#include "apron/run/ui/RunWithUi.h"
#include "apron/vm/Vm.h"
#include "common/error/UserError.h"
#include "common/files/AtomicFile.h"
#include "common/files/Inputs.h"
#include "common/process/StopSignals.h"
#include "common/text/Printable.h"

namespace apron::run {

void check_parameters(const Options& options, const program::Program& program) {
  for (const auto& [name, value] : options.parameters)
    if (const std::string problem = program::parameter_problem(program, name, value); !problem.empty())
      throw common::UserError("--set: " + problem);
}

HostEnvironment host_environment(const Options& options) {
  const bool has_clock = options.timers || options.window;
  return {options.cameras, has_clock ? Timers::Clock(wall_clock_s) : Timers::Clock(), options.frame_rate,
          options.keys, FileAccess(program_folders(options))};
}

namespace {

int print_error(int status, const std::string& text) {
  std::fflush(stdout);
  common::print_message("apron: " + text + "\n");
  return status;
}

// Instructions between two updates of the monitor; larger than any fused segment.
constexpr std::uint64_t kMonitorInterval = 8192;

vm::Status run_until_end(vm::Vm& vm, const Options& options, std::uint64_t& ticks) {
  std::optional<TerminalMonitor> monitor;
  if (!options.watch.empty()) {
    monitor.emplace(vm, options.watch);
    monitor->update();  // prepare the screen before the program prints
  }
  while (!options.ticks || ticks < *options.ticks) {
    const vm::Status status = monitor ? vm.run(kMonitorInterval) : vm.run();
    if (monitor) monitor->update();
    if (status == vm::Status::kTick)
      ++ticks;
    else if (status != vm::Status::kRunning)
      return status;
  }
  return vm::Status::kEnded;
}

// Checks before a run that its profile can probably be written. Throws common::UserError.
void check_profile_file(const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path folder = fs::absolute(file, ignored).parent_path();
  const bool is_folder = fs::is_directory(file, ignored);
  if (is_folder || !fs::is_directory(folder, ignored))
    throw common::UserError("--profile " + file + ": " +
                            (is_folder ? "it is a folder" : "there is no folder " + folder.string()));
}

bool write_profile(const program::Program& program, const std::vector<vm::InstructionProfile>& profile,
                   std::uint64_t ticks, const std::optional<CostModel>& model, const Options& options) {
  const std::error_code error =
      common::replace_file(options.profile, profile_json(program, profile, ticks, model));
  if (error)
    print_error(common::kFailed, "error: cannot write '" + options.profile + "': " + error.message());
  return !error;
}

int exit_status(vm::Status status, const std::string& error, const Options& options) {
  if (std::fflush(stdout) != 0 && status == vm::Status::kEnded)
    return print_error(common::kFailed, "error: cannot write the program's output");
  switch (status) {
    case vm::Status::kRunning:
    case vm::Status::kTick:
    case vm::Status::kEnded:
    case vm::Status::kClosed:
      return common::kDone;
    case vm::Status::kPeerLost:
      return print_error(common::kPeerLost, "the surface '" + options.surface + "' was lost");
    case vm::Status::kInterrupted:
      return 128 + common::stop_signal();
    case vm::Status::kRefused:
    case vm::Status::kFailed:
      break;
  }
  common::print_message(error + "\n");
  return status == vm::Status::kRefused ? common::kUserError : common::kFailed;
}

// The registers of --watch and --save and those that the simulator records, which may be read wherever the
// run stops.
std::vector<std::uint32_t> observed_registers(const Options& options, const program::Program& program,
                                              const RegisterView* shown) {
  std::vector<std::uint32_t> observed;
  const auto add = [&](const std::string& name) {
    if (const auto index = program::find_register(program, name))
      observed.push_back(static_cast<std::uint32_t>(*index));
  };
  if (!options.watch.empty()) add(options.watch);
  for (const SavedRegister& saved : options.saved) add(saved.name);
  if (shown != nullptr)
    for (const std::string& name : shown->names()) add(name);
  return observed;
}

RunResult run_headless(const Options& options, program::Program program, LocalHost& host,
                       RegisterView* shown) {
  vm::VmOptions vm_options;
  vm_options.threads = options.threads;
  vm_options.isa = options.isa;
  vm_options.stop = &common::stop_flag();
  vm_options.refuse_endless_ticks = options.ticks.has_value();
  vm_options.enable_profiling = !options.profile.empty();
  vm_options.fusion.observed = {false, observed_registers(options, program, shown), {}};
  vm::Vm vm(std::move(program), vm_options, host);
  if (shown != nullptr) host.before_answer([&] { shown->write(vm); });
  RunResult result;
  result.status = run_until_end(vm, options, result.ticks);
  host.before_answer({});
  result.error = vm.error();
  result.profile = vm.profile();
  result.save_error = save_registers(options.saved, vm);
  return result;
}

// The user interface's commands to the surface, and the surface's state that it draws.
struct UiSurface {
  std::function<void(bool)> on_pause;
  std::function<void()> on_finish;
  std::vector<std::array<float, 3>> positions = {};
  double pitch = 1.0;
};

std::vector<common::NamedOutput> named_outputs(const Options& options) {
  std::vector<common::NamedOutput> outputs;
  for (const Screenshot& screenshot : options.screenshots)
    outputs.push_back({"--screenshot", screenshot.file});
  if (!options.video.empty()) outputs.push_back({"--video", options.video});
  for (const SavedRegister& saved : options.saved) outputs.push_back({"--save", saved.file});
  if (!options.profile.empty()) outputs.push_back({"--profile", options.profile});
  return outputs;
}

// Compiles for the array's size, checks the options against the program and runs it. with_host() creates the
// host and passes it to its argument; it returns the exit status.
template <class WithHost>
int compile_and_run(const Options& options, std::uint32_t width, std::uint32_t height,
                    const WithHost& with_host) {
  CompilerMessages messages;
  const std::optional<CompiledProgram> compiled = compile_with_sources(options, width, height, messages);
  common::print_message(messages.text);
  if (!compiled) return common::kUserError;
  const program::Program& program = compiled->program;
  check_parameters(options, program);
  if (!options.watch.empty() && !program::find_register(program, options.watch))
    throw common::UserError("--watch: the program has no register " +
                            program::unknown_register(program, options.watch));
  check_saved(options.saved, program);
  if (const auto loop = program::find_endless_loop(program); options.ticks && loop)
    throw common::UserError(
        program::format_call_site(program, *loop) +
        "the program repeats forever without a frame, which --ticks counts: surface.step or "
        "sim.frame ends one");
  std::optional<CostModel> model;
  if (std::string error; !options.cost_model.empty()) {
    model = read_cost_model(find_library_file(options.cost_model), error);
    if (!model) {
      common::print_message(error + "\n");
      return common::kUserError;
    }
  }
  for (const std::string& camera : options.cameras) note_camera(camera);
  common::require_separate_outputs(named_outputs(options));
  common::end_of_inputs();
  std::optional<RegisterView> shown;
  if (options.shown_descriptor >= 0)
    shown.emplace(options.shown_descriptor, options.shown_registers, options.drawn_register, program, width,
                  height);
  RegisterView* const shown_registers = shown ? &*shown : nullptr;
  return with_host([&](LocalHost& host, const UiSurface& ui) {
    if (const std::string error = host.load_modules(program, options.modules, module_search_paths(options));
        !error.empty())
      throw common::UserError(error);
    const ConfinedProgram confined(options, named_outputs(options));
    RunResult ran;
    if (options.uses_ui()) {
      UiRunResult ui_result = run_with_ui({options, *compiled, width, height, host, ui.on_pause, ui.on_finish,
                                           shown_registers, ui.positions, ui.pitch});
      if (!ui_result.ui_error.empty()) throw common::UserError(ui_result.ui_error);
      ran = std::move(ui_result);
    } else {
      ran = run_headless(options, program, host, shown_registers);
    }
    const int exit = exit_status(ran.status, ran.error, options);
    if (!ran.save_error.empty())
      return std::max<int>(exit, print_error(common::kFailed, "error: " + ran.save_error));
    // A profile that the program may have overwritten is withheld; its own error says so.
    const bool written = options.profile.empty() || common::withheld(options.profile) ||
                         write_profile(program, ran.profile, ran.ticks, model, options);
    return written ? exit : std::max<int>(exit, common::kFailed);
  });
}

const std::atomic<bool>& wait_stop_flag(const Options& options) {
  return options.uses_ui() ? common::interrupt_flag() : common::stop_flag();
}

int run_local(const Options& options) {
  return compile_and_run(options, options.width, options.height, [&](const auto& go) {
    LocalHost host(options.parameters, wait_stop_flag(options), host_environment(options));
    return go(host, {});
  });
}

// Attaches to the surface and runs the program until either side ends the session.
int run_surface_session(const Options& options, std::chrono::nanoseconds timeout) {
  using shm_protocol::ControllerEndpoint;
  ControllerEndpoint surface =
      ControllerEndpoint::attach(options.surface, {.timeout = timeout, .stop = &common::stop_flag()});
  const shm_protocol::Description& description = surface.description();
  return compile_and_run(options, description.columns, description.rows, [&](const auto& go) {
    SurfaceHost host(surface, wait_stop_flag(options), options.parameters, host_environment(options));
    switch (host.await_first_frame()) {
      case vm::HostStatus::kOk:
        return go(host, {[&host](bool paused) { host.publish_paused(paused); }, [&host] { host.close(); },
                         description.positions, description.pitch});
      case vm::HostStatus::kClosed:
        return static_cast<int>(common::kDone);
      case vm::HostStatus::kInterrupted:
        return exit_status(vm::Status::kInterrupted, "", options);
      case vm::HostStatus::kPeerLost:
        return exit_status(vm::Status::kPeerLost, "", options);
      default:
        return print_error(common::kFailed, "error: " + host.message());
    }
  });
}

int report_attach_error(const shm_protocol::Error& error) {
  using shm_protocol::ErrorCode;
  if (error.code() == ErrorCode::kInterrupted) return 128 + common::stop_signal();
  return print_error(error.code() == ErrorCode::kSystem ? common::kFailed : common::kUserError,
                     std::string("error: ") + error.what());
}

int run_on_surface(const Options& options) {
  constexpr std::chrono::hours kReconnectTimeout{24 * 365};
  std::chrono::nanoseconds timeout =
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(options.wait_s));
  for (;;) {
    const int status = run_surface_session(options, timeout);
    if (status != common::kPeerLost || !options.reconnect) return status;
    common::print_message("apron: waiting for a new surface '" + options.surface + "'\n");
    timeout = kReconnectTimeout;
  }
}

}  // namespace

int run_program(const Options& options) {
  common::catch_stop_signals();
  if (!options.profile.empty()) check_profile_file(options.profile);
  if (options.uses_ui())
    if (const std::string reason = ui_unavailable_reason(options); !reason.empty())
      throw common::UserError(reason);
  try {
    return options.surface.empty() ? run_local(options) : run_on_surface(options);
  } catch (const shm_protocol::Error& error) {
    return report_attach_error(error);
  } catch (const std::bad_alloc&) {
    return print_error(common::kFailed, "error: there is not enough memory for the program's registers");
  }
}

int check_program(const Options& options) {
  const std::optional<program::Program> program = compile_or_report(options, options.width, options.height);
  if (!program) return common::kUserError;
  if (program::uses_surface(*program)) {
    if (!program::can_reach(*program, program::Opcode::kSurfaceStep)) {
      common::print_message(options.program +
                            ": warning: the program uses the surface and never reaches surface.step, "
                            "for which the surface waits\n");
    } else if (const std::optional<std::size_t> loop = program::find_loop_without_step(*program)) {
      const program::SourceLocation& source = *program::find_location(*program, *loop);
      common::print_message(program->files[source.file] + ":" + std::to_string(source.line) +
                            ": warning: from here the program repeats forever without surface.step, for "
                            "which the surface waits\n");
    }
  }
  if (const std::string errors = body_errors(options); !errors.empty()) {
    common::print_message(errors);
    return common::kUserError;
  }
  if (!options.local_check) return common::kDone;
  const std::vector<program::NonLocalInstruction> nonlocal = program::find_nonlocal_instructions(*program);
  for (const program::NonLocalInstruction& instruction : nonlocal) {
    const program::SourceLocation& source = *program::find_location(*program, instruction.instruction);
    common::print_output(program->files[source.file] + ":" + std::to_string(source.line) +
                         ": not local: " + instruction.reason + "\n");
  }
  if (!nonlocal.empty()) return common::kFailed;
  common::print_output(options.program + ": every instruction is local\n");
  return common::kDone;
}

int disassemble_program(const Options& options) {
  const std::optional<program::Program> program = compile_or_report(options, options.width, options.height);
  if (!program) return common::kUserError;
  common::print_output(program::disassemble(*program));
  return common::kDone;
}

}  // namespace apron::run
