// The controller as a child process: started with the run, watched, and ended with it.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace smartsurf::run {

class ControllerProcess {
 public:
  // Starts `controller`: a program of ours when it ends in .aps (run by the apron beside this executable),
  // else a shell command in which {shm} stands for the segment's name; SMARTSURF_SHM holds it too. Throws
  // scene::InputError when the program does not exist or apron is not there.
  // with_window: a program of ours opens its window too, on the right of the screen. set: NAME=VALUE of its
  // sliders and switches, which it judges itself.
  ControllerProcess(const std::string& controller, const std::string& shm_name, bool with_window = false,
                    const std::vector<std::string>& overrides = {});
  // Asks it to end, waits, and kills it if it will not.
  ~ControllerProcess();
  ControllerProcess(const ControllerProcess&) = delete;
  ControllerProcess& operator=(const ControllerProcess&) = delete;

  // How it ended, once it has: its exit status, or 128 + signal.
  std::optional<int> exit_status();
  // Waits up to `patience` for its own end.
  std::optional<int> wait_for_exit(std::chrono::milliseconds timeout);

 private:
  pid_t pid_ = -1;
  std::optional<int> status_;
};

// Whether this --controller is a program of ours, which can have a window.
bool is_apron_program(const std::string& controller);

// The command that attaches a controller to a waiting surface, for the user to copy.
std::string attach_command(const std::string& shm_name);

}  // namespace smartsurf::run
