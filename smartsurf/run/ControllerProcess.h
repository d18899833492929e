// The controller as a child process that is started and ended with the run.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace smartsurf::run {

class ControllerProcess {
 public:
  // Starts `controller`, which is an APRON program (*.aps), run by the apron beside this executable, a policy
  // (*.onnx), run by the Python package, or a shell command, in which {shm} stands for the segment's name.
  // SMARTSURF_SHM holds that name too. What a shell command has started ends with it, and with this process,
  // however either ends. Throws scene::InputError if the program does not exist, std::system_error if no
  // process can be created. If the command cannot be executed, the child reports it and exits with status 2.
  // with_window: an APRON program also opens its window, beside that of the run. overrides: NAME=VALUE of the
  // program's sliders and switches; apron validates them. show_registers: the value of apron's
  // --show-registers; "": none.
  ControllerProcess(const std::string& controller, const std::string& shm_name, bool with_window = false,
                    const std::vector<std::string>& overrides = {}, const std::string& show_registers = "");
  // The controller of another process, which starts it here.
  struct Remote {
    std::function<void()> start;
    std::function<std::optional<int>()> exit_status;
    std::function<void(int)> send_signal;
  };
  explicit ControllerProcess(Remote);
  // Sends SIGTERM and, if the process is still running after 2 s, SIGKILL.
  ~ControllerProcess();
  ControllerProcess(const ControllerProcess&) = delete;
  ControllerProcess& operator=(const ControllerProcess&) = delete;

  // The exit status, or 128 + signal; nullopt while the process is running.
  std::optional<int> exit_status();
  // Waits up to `timeout` for the process to exit.
  std::optional<int> wait_for_exit(std::chrono::milliseconds timeout);
  void send_signal(int signal);

 private:
  std::optional<Remote> remote_;
  pid_t pid_ = -1;
  std::optional<int> status_;
};

// Returns whether --controller names an APRON program, which can have a window.
bool is_apron_program(const std::string& controller);

// Returns whether it names an ONNX model.
bool is_onnx_model(const std::string& controller);
// Either is an input of the run (common/files/Inputs.h).
void note_controller(const std::string& controller);

// The APRON program beside the experiment that has its name, else the only one there, else "".
std::string program_beside(const std::string& experiment);

// The shell command that attaches a controller to a waiting surface, shown to the user: program_beside(), or
// else PROGRAM.aps.
std::string attach_command(const std::string& experiment, const std::string& shm_name, bool with_window);

}  // namespace smartsurf::run
