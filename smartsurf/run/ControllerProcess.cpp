#include "smartsurf/run/ControllerProcess.h"

#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <thread>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// The apron that was built or installed with this smartsurf; else whatever PATH has.
std::string apron_executable() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const fs::path beside = self.parent_path() / "apron";
  return !error && access(beside.c_str(), X_OK) == 0 ? beside.string() : "apron";
}

std::vector<std::string> command_for(const std::string& controller, const std::string& shm_name,
                                     bool with_window) {
  if (is_apron_program(controller)) {
    if (!fs::is_regular_file(controller))
      throw scene::InputError(fmt::format("--controller {}: no such program", controller));
    std::vector<std::string> command = {apron_executable(), "run", controller, "--shm", shm_name};
    if (with_window) command.insert(command.end(), {"--window", "--geometry", "beside"});
    return command;
  }
  std::string command = controller;
  static const std::string kPlace = "{shm}";
  for (std::size_t at = 0; (at = command.find(kPlace, at)) != std::string::npos; at += shm_name.size())
    command.replace(at, kPlace.size(), shm_name);
  return {"/bin/sh", "-c", command};
}

[[noreturn]] void become(const std::vector<std::string>& command, const std::string& shm_name) {
  setenv("SMARTSURF_SHM", shm_name.c_str(),
         1);  // here, in the child: several worlds share the parent's environment
  // If the simulator is killed outright, the controller must not outlive it for long.
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  std::vector<char*> arguments;
  for (const auto& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  execvp(arguments[0], arguments.data());
  if (errno == ENOENT)
    fmt::print(stderr, "smartsurf: cannot start {}: it is neither beside smartsurf nor on PATH\n",
               command[0]);
  else
    fmt::print(stderr, "smartsurf: cannot start {}: {}\n", command[0], std::strerror(errno));
  _exit(2);
}

}  // namespace

bool is_apron_program(const std::string& controller) {
  return controller.ends_with(".aps") && controller.find_first_of(" \t;|&<>$") == std::string::npos;
}

ControllerProcess::ControllerProcess(const std::string& controller, const std::string& shm_name,
                                     bool with_window) {
  const std::vector<std::string> command = command_for(controller, shm_name, with_window);
  pid_ = fork();
  if (pid_ < 0) throw std::system_error(errno, std::generic_category(), "cannot start the controller");
  if (pid_ == 0) become(command, shm_name);
}

ControllerProcess::~ControllerProcess() {
  for (const int signal : {SIGTERM, SIGKILL}) {
    if (exit_status()) return;
    kill(pid_, signal);
    if (wait_for_exit(2s)) return;
  }
}

std::optional<int> ControllerProcess::exit_status() {
  if (status_) return status_;
  int raw = 0;
  if (waitpid(pid_, &raw, WNOHANG) == pid_) status_ = WIFEXITED(raw) ? WEXITSTATUS(raw) : 128 + WTERMSIG(raw);
  return status_;
}

std::optional<int> ControllerProcess::wait_for_exit(std::chrono::milliseconds patience) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!exit_status() && std::chrono::steady_clock::now() < deadline) std::this_thread::sleep_for(2ms);
  return status_;
}

std::string attach_command(const std::string& shm_name) {
  return fmt::format("{} run PROGRAM.aps --shm {}", apron_executable(), shm_name);
}

}  // namespace smartsurf::run
