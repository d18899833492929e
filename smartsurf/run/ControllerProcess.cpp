#include "smartsurf/run/ControllerProcess.h"

#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "common/files/Inputs.h"
#include "common/files/Installation.h"
#include "common/files/ProgramOnPath.h"
#include "common/process/Supervisor.h"
#include "common/text/Printable.h"
#include "common/text/Words.h"
#include "smartsurf/run/PythonModule.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// Prefers the apron built or installed with this smartsurf to the one on PATH.
std::string apron_executable() {
  const fs::path sibling = common::program_path().parent_path() / "apron";
  return sibling.has_root_path() && access(sibling.c_str(), X_OK) == 0 ? sibling.string() : "apron";
}

// Names the program as a user would type it: by its name alone if PATH leads to it, else by a path relative
// to the current folder if it lies below that.
std::string typed_name(const fs::path& executable) {
  std::error_code error;
  const fs::path found = common::program_on_path(executable.filename());
  if (!found.empty() && fs::equivalent(found, executable, error)) return executable.filename().string();
  const fs::path relative = fs::proximate(executable, error);
  return error || relative.empty() || *relative.begin() == ".." ? executable.string() : relative.string();
}

std::vector<std::string> make_command(const std::string& controller, const std::string& shm_name,
                                      bool with_window, const std::vector<std::string>& overrides,
                                      const std::string& show_registers) {
  const bool is_model = is_onnx_model(controller);
  std::error_code error;
  const fs::file_status status = fs::status(controller, error);
  if ((is_model || is_apron_program(controller)) && !fs::is_regular_file(status))
    throw scene::InputError(fmt::format("--controller {}: {}", controller,
                                        fs::exists(status) ? "is not a regular file"
                                        : is_model         ? "no such model"
                                                           : "no such program"));
  if (is_model) return python_command("onnx_controller", {controller, "--shm", shm_name});
  if (is_apron_program(controller)) {
    std::vector<std::string> command = {apron_executable(), "run", controller, "--shm", shm_name};
    if (with_window) command.insert(command.end(), {"--window", "--geometry", "beside"});
    for (const std::string& assignment : overrides) command.insert(command.end(), {"--set", assignment});
    if (!show_registers.empty()) command.insert(command.end(), {"--show-registers", show_registers});
    return command;
  }
  std::string command = controller;
  static const std::string kShmPlaceholder = "{shm}";
  for (std::size_t position = 0; (position = command.find(kShmPlaceholder, position)) != std::string::npos;
       position += shm_name.size())
    command.replace(position, kShmPlaceholder.size(), shm_name);
  return {"/bin/sh", "-c", command};
}

// Becomes the command. An exception would unwind the simulator's stack in its child, and remove its files
// there.
[[noreturn]] void exec_command(const std::vector<std::string>& command, const std::string& shm_name,
                               pid_t parent) noexcept {
  // Set in the child only, because several worlds share the parent's environment.
  setenv("SMARTSURF_SHM", shm_name.c_str(), 1);
  common::execute(command, parent, SIGTERM);
  if (errno == ENOENT)
    common::print_message(
        fmt::format("smartsurf: cannot start {}: it is neither beside smartsurf nor on PATH\n", command[0]));
  else
    common::print_message(fmt::format("smartsurf: cannot start {}: {}\n", command[0], std::strerror(errno)));
  _exit(2);
}

// Not a command, unless a file has its text for a name.
bool is_file_name(const std::string& controller, std::string_view extension) {
  std::error_code ignored;
  return controller.ends_with(extension) && (controller.find_first_of(" \t;|&<>$") == std::string::npos ||
                                             fs::is_regular_file(controller, ignored));
}

}  // namespace

bool is_apron_program(const std::string& controller) { return is_file_name(controller, ".aps"); }

bool is_onnx_model(const std::string& controller) { return is_file_name(controller, ".onnx"); }

void note_controller(const std::string& controller) {
  if (is_apron_program(controller) || is_onnx_model(controller)) common::note_input(fs::path(controller));
}

ControllerProcess::ControllerProcess(const std::string& controller, const std::string& shm_name,
                                     bool with_window, const std::vector<std::string>& overrides,
                                     const std::string& show_registers) {
  const std::vector<std::string> command =
      make_command(controller, shm_name, with_window, overrides, show_registers);
  const pid_t parent = getpid();
  pid_ = fork();
  if (pid_ < 0) throw std::system_error(errno, std::generic_category(), "cannot start the controller");
  if (pid_ != 0) return;
  if (is_onnx_model(controller)) drop_relative_python_path();
  if (is_apron_program(controller) || is_onnx_model(controller)) exec_command(command, shm_name, parent);
  // A shell and what it starts may outlive the signals that end it.
  common::supervise({.parent = parent, .become_command = [&](pid_t supervisor) {
                       exec_command(command, shm_name, supervisor);
                     }});
}

ControllerProcess::ControllerProcess(Remote remote) : remote_(std::move(remote)) { remote_->start(); }

ControllerProcess::~ControllerProcess() {
  for (const int signal : {SIGTERM, SIGKILL}) {
    if (exit_status()) return;
    send_signal(signal);
    if (wait_for_exit(2s)) return;
  }
}

std::optional<int> ControllerProcess::exit_status() {
  if (status_) return status_;
  if (remote_) return status_ = remote_->exit_status();
  int wait_status = 0;
  if (waitpid(pid_, &wait_status, WNOHANG) == pid_)
    status_ = WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);
  return status_;
}

void ControllerProcess::send_signal(int signal) {
  if (remote_)
    remote_->send_signal(signal);
  else if (!exit_status())
    kill(pid_, signal);
}

std::optional<int> ControllerProcess::wait_for_exit(std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (!exit_status() && std::chrono::steady_clock::now() < deadline) std::this_thread::sleep_for(2ms);
  return status_;
}

std::string program_beside(const std::string& experiment) {
  const fs::path folder = fs::path(experiment).parent_path(),
                 same_name = fs::path(experiment).replace_extension(".aps");
  std::error_code error;
  if (fs::is_regular_file(same_name, error)) return same_name.string();
  std::vector<std::string> programs;
  for (const fs::directory_entry& entry :
       fs::directory_iterator(folder.empty() ? fs::path(".") : folder, error))
    if (entry.path().extension() == ".aps") programs.push_back((folder / entry.path().filename()).string());
  return programs.size() == 1 ? programs.front() : "";
}

std::string attach_command(const std::string& experiment, const std::string& shm_name, bool with_window) {
  const std::string program = program_beside(experiment);
  return fmt::format("{} run {} --shm {}{}", common::shell_word(typed_name(apron_executable())),
                     program.empty() ? "PROGRAM.aps" : common::shell_word(program),
                     common::shell_word(shm_name), with_window ? " --window" : "");
}

}  // namespace smartsurf::run
