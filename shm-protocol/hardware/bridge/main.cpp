// surface_bridge: the surface role for a physical device on a serial line or behind TCP.
#include <fcntl.h>
#include <shm_protocol/Error.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <thread>

#include "common/cli/Flags.h"
#include "common/files/AtomicFile.h"
#include "common/process/ExitStatus.h"
#include "common/process/StandardStreams.h"
#include "common/process/StopSignals.h"
#include "common/process/Termination.h"
#include "common/text/Number.h"
#include "common/text/Printable.h"
#include "shm-protocol/hardware/bridge/Bridge.h"
#include "shm-protocol/hardware/bridge/Calibrator.h"
#include "shm-protocol/hardware/bridge/TableBridge.h"

namespace {

using hardware::Bridge;
using hardware::BridgeOptions;
using std::chrono::milliseconds;

constexpr const char* kUsage =
    "usage: surface_bridge DEVICE [flags]\n"
    "       surface_bridge --table TABLE.toml [flags]\n"
    "       surface_bridge calibrate TABLE.toml -o FILE.toml [--rest HEIGHT] [--hold S] [flags]\n"
    "       surface_bridge stop|arm|status NAME\n"
    "The surface role for a physical device. DEVICE is a serial line (/dev/ttyUSB0) or tcp:HOST:PORT; the "
    "device\n"
    "describes itself, and its clock drives the session (docs/hardware.md). stop is the emergency stop of a "
    "running\n"
    "bridge, which arm releases; status prints the state of its boards.\n"
    "  --table FILE     many boards as one surface, whose name and boards are in FILE; the host's clock "
    "drives the "
    "session\n"
    "  --calibration FILE  of the table, instead of the one that its file names\n"
    "  --baud N         speed of a serial line [115200]\n"
    "  --shm NAME       name for controllers to attach to [surface; the table's]\n"
    "  --mode MODE      time-step (one answer to each sensor frame) or passive (no side waits) "
    "[time-step]\n"
    "  --ticks N        end after N sensor frames [never]\n"
    "  --silence S      seconds without a sensor frame, at least four periods, after which the\n"
    "                   device is silent [0.5]\n"
    "  --connect S      seconds to wait at the start, for the table's file and the device [10]\n"
    "  --replug S       seconds to wait for a device that was lost [for ever]\n"
    "  --record FILE    record the session, as smartsurf record does\n"
    "  --hold           without a controller the device keeps the last frame [it gets the safe values]\n"
    "calibrate drives all cells of the table through their range and fits how each answers:\n"
    "  -o FILE.toml     the calibration; pictures of it go beside it, with the ending .svg\n"
    "  --rest HEIGHT    all cells lie at HEIGHT, undriven since the boards were switched on: tells the "
    "sensors' "
    "zeros from\n"
    "                   those of the actuators\n"
    "  --hold S         seconds that a step is held, 0.01 to 60: at least a full stroke and five lags [1]\n"
    "  --actuator NAME, --sensor NAME    [the only ones of one component and equal unit]\n"
    "Exit status: 0 done; 1 failed; 2 wrong input; 3 the device did not appear or return; 128 + n "
    "after\n"
    "signal n.\n";

template <class Number>
Number parse(const char* flag, const char* text, Number least, Number most, const char* what) {
  Number value{};
  if (!common::parse_number(text, value) || !(value >= least && value <= most))
    throw std::invalid_argument(std::string("--") + flag + ": '" + text + "' is not " + what);
  return value;
}

milliseconds parse_seconds(const char* flag, const char* text) {
  const double s = parse(flag, text, 0.001, 1e6, "a time in seconds from 0.001 to 1000000");
  return std::chrono::duration_cast<milliseconds>(std::chrono::duration<double>(s));
}

// Throws if no file of this name can be written; a full disk shows only later.
void require_writable(const std::string& flag, const std::string& file) {
  std::error_code none;
  const auto folder = std::filesystem::absolute(file).parent_path();
  const std::string what = flag + " " + file + ": ";
  if (!std::filesystem::is_directory(folder, none))
    throw std::invalid_argument(what + "there is no folder " + folder.string());
  if (std::filesystem::is_directory(file, none)) throw std::invalid_argument(what + "is a folder");
}

shm_protocol::Mode parse_mode(const std::string& text) {
  if (text == "time-step") return shm_protocol::Mode::kTimeStep;
  if (text == "passive") return shm_protocol::Mode::kPassive;
  throw std::invalid_argument("--mode: '" + text + "' is neither time-step nor passive");
}

struct Arguments {
  BridgeOptions bridge;
  std::optional<std::string> table, record, calibration;
  // calibrate
  bool calibrate = false;
  std::string output;
  hardware::CalibratorOptions calibrator;
};

// The pictures of a calibration.
std::filesystem::path maps_file(const Arguments& arguments) {
  return std::filesystem::path(arguments.output).replace_extension(".svg");
}

// Returns whether --help was requested and printed.
bool read_flags(int argc, char** argv, std::vector<common::Flag> flags) {
  flags.push_back({"help", no_argument, nullptr, 'h'});
  const std::string_view stopped_at = common::read_flags(argc, argv, flags);
  if (stopped_at == "?") throw std::invalid_argument("see --help");
  if (!stopped_at.empty()) std::fputs(kUsage, stdout);
  return !stopped_at.empty();
}

// Returns nothing if --help was requested and printed.
std::optional<Arguments> parse(int argc, char** argv) {
  Arguments arguments;
  BridgeOptions& o = arguments.bridge;
  bool named = false, has_baud = false;
  unsigned baud = 115200;
  const bool is_help =
      read_flags(argc, argv,
                 {{"baud", required_argument,
                   [&](const char* text) {
                     has_baud = true;
                     baud = parse("baud", text, 1u, 10'000'000u, "a speed in bits a second");
                   }},
                  {"shm", required_argument, [&](const char* text) { o.surface = text, named = true; }},
                  {"record", required_argument, [&](const char* text) { arguments.record = text; }},
                  {"calibration", required_argument, [&](const char* text) { arguments.calibration = text; }},
                  {"table", required_argument, [&](const char* text) { arguments.table = text; }},
                  {"mode", required_argument, [&](const char* text) { o.mode = parse_mode(text); }},
                  {"ticks", required_argument,
                   [&](const char* text) {
                     o.ticks = parse<std::uint64_t>("ticks", text, 1, ~0ull, "a whole number from 1");
                   }},
                  {"silence", required_argument,
                   [&](const char* text) { o.silence_timeout = parse_seconds("silence", text); }},
                  {"connect", required_argument,
                   [&](const char* text) { o.connect_timeout = parse_seconds("connect", text); }},
                  {"replug", required_argument,
                   [&](const char* text) { o.reconnect_timeout = parse_seconds("replug", text); }},
                  {"hold", no_argument, [&](const char*) { o.hold_last_frame = true; }}});
  if (is_help) return std::nullopt;
  if (arguments.record) {
    const std::string extension = std::filesystem::path(*arguments.record).extension();
    if (extension != ".h5" && extension != ".hdf5")
      throw std::invalid_argument("--record " + *arguments.record + ": the name must end in .h5 or .hdf5");
    require_writable("--record", *arguments.record);
  }
  if (arguments.table) {
    if (has_baud) throw std::invalid_argument("--baud: the speeds of a table's lines are in its file");
    if (::optind != argc) throw std::invalid_argument("the devices of a table are in its file");
    if (!named) o.surface.clear();
    return arguments;
  }
  if (arguments.calibration) throw std::invalid_argument("--calibration needs --table");
  if (::optind + 1 != argc)
    throw std::invalid_argument("one DEVICE is needed: a serial line or tcp:HOST:PORT");
  o.port = hardware::PortAddress::parse(argv[::optind], baud);
  return arguments;
}

// Arguments of `surface_bridge calibrate`.
std::optional<Arguments> parse_calibrate(int argc, char** argv) {
  Arguments arguments;
  arguments.calibrate = true;
  BridgeOptions& o = arguments.bridge;
  o.surface.clear();
  o.mode = shm_protocol::Mode::kPassive;
  hardware::CalibratorOptions& c = arguments.calibrator;
  const bool is_help =
      read_flags(argc, argv,
                 {{"output", required_argument, [&](const char* text) { arguments.output = text; }, 'o'},
                  {"rest", required_argument,
                   [&](const char* text) { c.rest = parse("rest", text, -1e6, 1e6, "a height"); }},
                  {"hold", required_argument,
                   [&](const char* text) {
                     c.hold_s = parse("hold", text, 0.01, 60.0, "a time in seconds from 0.01 to 60");
                   }},
                  {"shm", required_argument, [&](const char* text) { o.surface = text; }},
                  {"actuator", required_argument, [&](const char* text) { c.actuator = text; }},
                  {"sensor", required_argument, [&](const char* text) { c.sensor = text; }},
                  {"connect", required_argument,
                   [&](const char* text) { o.connect_timeout = parse_seconds("connect", text); }},
                  {"silence", required_argument,
                   [&](const char* text) { o.silence_timeout = parse_seconds("silence", text); }}});
  if (is_help) return std::nullopt;
  if (::optind + 1 != argc) throw std::invalid_argument("calibrate needs one TABLE.toml");
  if (arguments.output.empty()) throw std::invalid_argument("calibrate needs -o FILE.toml");
  arguments.table = argv[::optind];
  if (std::filesystem::path(arguments.output).extension() != ".toml")
    throw std::invalid_argument("-o " + arguments.output +
                                ": the name must end in .toml; pictures go beside it");
  std::error_code none;
  for (const auto& file : {std::filesystem::path(arguments.output), maps_file(arguments)})
    if (std::filesystem::equivalent(*arguments.table, file, none))
      throw std::invalid_argument("-o " + arguments.output + ": " + file.string() + " is the table itself");
  require_writable("-o", arguments.output);
  return arguments;
}

std::string report(const hardware::BridgeCounters& c) {
  const auto n = [](std::uint64_t value) { return static_cast<unsigned long long>(value); };
  char text[512];
  std::snprintf(text, sizeof text,
                "frames %llu answers %llu lost %llu passed_over %llu missed %llu unsent %llu silences %llu "
                "reconnections %llu damaged_packets %llu lost_packets %llu\n",
                n(c.frames), n(c.answers), n(c.lost), n(c.skipped), n(c.missed_deadlines), n(c.unsent),
                n(c.silences), n(c.reconnections), n(c.damaged_packets), n(c.lost_packets));
  return text;
}

// `smartsurf record`, which ends with the surface. Its lines go to the standard error.
class RecorderProcess {
 public:
  RecorderProcess(const std::string& surface, const std::string& file) {
    // A signal that comes between fork and exec ends the child, although this process catches it.
    sigset_t term, before;
    sigemptyset(&term);
    sigaddset(&term, SIGTERM);
    sigprocmask(SIG_BLOCK, &term, &before);
    const std::string parent = std::to_string(::getpid());
    std::array<int, 2> ready{-1, -1};
    if (::pipe2(ready.data(), O_CLOEXEC | O_NONBLOCK) != 0)
      throw std::runtime_error(std::string("cannot start smartsurf record: ") + std::strerror(errno));
    pid_ = ::fork();
    const int error = errno;
    if (pid_ == 0) ::signal(SIGTERM, SIG_DFL);
    sigprocmask(SIG_SETMASK, &before, nullptr);
    if (pid_ != 0) ::close(ready[1]);
    ready_ = ready[0];
    if (pid_ < 0) {
      ::close(ready_);
      throw std::runtime_error(std::string("cannot start smartsurf record: ") + std::strerror(error));
    }
    if (pid_ != 0) return;
    ::fcntl(ready[1], F_SETFD, 0);
    ::setenv("SMARTSURF_READY", std::to_string(ready[1]).c_str(), 1);
    ::setenv("SMARTSURF_PARENT", parent.c_str(), 1);  // it may still wait for a surface that never was
    ::dup2(STDERR_FILENO, STDOUT_FILENO);
    std::error_code none;
    const auto beside = std::filesystem::read_symlink("/proc/self/exe", none).parent_path() / "smartsurf";
    const std::string program = std::filesystem::exists(beside, none) ? beside.string() : "smartsurf";
    ::execlp(program.c_str(), "smartsurf", "record", "--shm", surface.c_str(), "-o", file.c_str(), "--wait",
             "1000000", nullptr);
    common::print_error_line("surface_bridge",
                             "cannot start smartsurf record: " + std::string(std::strerror(errno)));
    ::_exit(common::kFailed);
  }
  ~RecorderProcess() {
    if (pid_ > 0) finish(true);
    ::close(ready_);
  }
  RecorderProcess(const RecorderProcess&) = delete;
  RecorderProcess& operator=(const RecorderProcess&) = delete;

  // Returns whether it is attached to the surface, or has ended, of which it says so.
  bool is_ready() {
    if (int status = 0; pid_ > 0 && !common::stop_flag() && ::waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = 0;
      print_end(status, "; the session goes on");
    }
    char byte = 0;
    if (!is_attached_) is_attached_ = ::read(ready_, &byte, 1) == 1;
    return is_attached_ || pid_ == 0;
  }

  // Waits for its end, from 5 s on with SIGTERM and from 10 s on with SIGKILL. Returns whether it recorded
  // all. `stop`: it may still wait for a surface that never was.
  bool finish(bool stop) {
    using std::chrono::seconds;
    if (pid_ == 0) return false;  // it ended early
    if (stop) ::kill(pid_, SIGTERM);
    int status = 0;
    const auto begun = std::chrono::steady_clock::now();
    seconds next{5};
    for (pid_t ended = 0; (ended = ::waitpid(pid_, &status, WNOHANG)) == 0 || (ended < 0 && errno == EINTR);
         std::this_thread::sleep_for(milliseconds(2))) {
      if (std::chrono::steady_clock::now() - begun < next) continue;
      ::kill(pid_, next == seconds(5) ? SIGTERM : SIGKILL);
      next += seconds(5);
    }
    pid_ = 0;
    const bool recorded =
        WIFEXITED(status) && (WEXITSTATUS(status) == common::kDone || WEXITSTATUS(status) > 128);
    if (!recorded) print_end(status, "");
    return recorded;
  }

 private:
  static void print_end(int status, const std::string& more) {
    common::print_error_line("surface_bridge",
                             "smartsurf record ended " +
                                 (WIFEXITED(status) ? "with status " + std::to_string(WEXITSTATUS(status))
                                                    : "by signal " + std::to_string(WTERMSIG(status))) +
                                 ": the recording is not whole" + more);
  }

  pid_t pid_ = 0;
  int ready_ = -1;  // the end of a pipe that says that it is attached
  bool is_attached_ = false;
};

int exit_status(hardware::Outcome end) {
  if (std::fflush(stdout) != 0) return common::kFailed;
  switch (end) {
    case hardware::Outcome::kDone:
      return common::kDone;
    case hardware::Outcome::kStopped:
      return common::status_after_signals(common::kDone);
    case hardware::Outcome::kDeviceLost:
      return common::kPeerLost;
    case hardware::Outcome::kFailed:
      break;
  }
  return common::kFailed;
}

void print_event(const std::string& line) { common::print_error_line("surface_bridge", line); }

// Awaits a file that is yet to be written, as emulated boards do, like the boards themselves. Returns nothing
// if a signal ends the wait.
std::optional<hardware::TableSpec> await_table(const Arguments& arguments) {
  const auto until = std::chrono::steady_clock::now() + arguments.bridge.connect_timeout;
  const auto& stop = common::catch_stop_signals();
  std::error_code none;
  if (!std::filesystem::exists(*arguments.table, none))
    print_event(*arguments.table + ": there is no such file yet; waiting for it");
  while (!std::filesystem::exists(*arguments.table, none) && std::chrono::steady_clock::now() < until) {
    if (stop.load()) return std::nullopt;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return hardware::read_table(*arguments.table);
}

int serve(const Arguments& arguments) {
  std::optional<RecorderProcess> recorder;
  BridgeOptions options = arguments.bridge;
  if (arguments.record) options.is_recorder_ready = [&] { return recorder->is_ready(); };
  const auto start_recorder = [&](const std::string& surface) {
    if (arguments.record) recorder.emplace(surface, *arguments.record);
  };
  const auto finish = [&](hardware::Outcome end, bool served, const std::string& report) {
    const bool recorded = !recorder || recorder->finish(!served);
    if (served || end == hardware::Outcome::kDone) std::fputs(report.c_str(), stdout);
    const int status = exit_status(end);
    return recorded || status != common::kDone ? status : common::kFailed;
  };
  if (arguments.table) {
    std::optional<hardware::TableSpec> table = await_table(arguments);
    if (!table) return exit_status(hardware::Outcome::kStopped);
    if (arguments.calibration) table->calibration = *arguments.calibration;
    hardware::TableBridge bridge(*table, options, common::catch_stop_signals(), print_event);
    start_recorder(arguments.bridge.surface.empty() ? table->name : arguments.bridge.surface);
    const hardware::Outcome end = bridge.run();
    return finish(end, bridge.served(), bridge.report());
  }
  Bridge bridge(options, common::catch_stop_signals(), print_event);
  start_recorder(arguments.bridge.surface);
  const hardware::Outcome end = bridge.run();
  return finish(end, bridge.counters().frames != 0, report(bridge.counters()));
}

void write_file(const std::filesystem::path& path, const std::string& text) {
  if (const std::error_code error = common::replace_file(path, text))
    throw std::runtime_error("cannot write " + path.string() + ": " + error.message());
}

int calibrate(const Arguments& arguments) {
  const std::optional<hardware::TableSpec> table = await_table(arguments);
  if (!table) return exit_status(hardware::Outcome::kStopped);
  hardware::Calibrator calibrator(*table, arguments.calibrator);
  hardware::TableBridge bridge(*table, arguments.bridge, common::catch_stop_signals(), print_event,
                               &calibrator);
  const hardware::Outcome end = bridge.run();
  if (!calibrator.failure().empty()) {
    common::print_error_line("surface_bridge: error", calibrator.failure());
    return common::kFailed;
  }
  if (!calibrator.done()) return exit_status(end);
  const hardware::Calibration fitted = calibrator.fit();
  write_file(arguments.output, fitted.text());
  write_file(maps_file(arguments), hardware::calibration_maps(fitted));
  const auto adjust = hardware::cells_to_adjust(fitted, calibrator.lowest(), calibrator.highest());
  std::printf("%zu cells, %zu to be adjusted or repaired\n", fitted.present_cells(), adjust.size());
  for (const std::string& board : calibrator.absent_boards())
    std::printf("%s is absent\n", common::printable(board).c_str());
  if (calibrator.repeats() > 0)
    std::printf("%d parts were repeated, the last one because %s\n", calibrator.repeats(),
                common::printable(calibrator.last_disturbance()).c_str());
  for (const std::string& line : adjust) std::printf("%s\n", common::printable(line).c_str());
  return exit_status(end);
}

bool is_command(const char* word) {
  return std::strcmp(word, "stop") == 0 || std::strcmp(word, "arm") == 0 || std::strcmp(word, "status") == 0;
}

int ask(int argc, char** argv) {
  if (argc != 3)
    throw std::invalid_argument(std::string(argv[1]) + " needs the NAME of a running bridge's surface");
  try {
    std::fputs(hardware::ask_bridge(argv[2], argv[1]).c_str(), stdout);
  } catch (const std::runtime_error& e) {
    common::print_error_line("surface_bridge: error", e.what());
    return common::kPeerLost;
  }
  return std::fflush(stdout) == 0 ? common::kDone : common::kFailed;
}

}  // namespace

int main(int argc, char** argv) {
  common::open_standard_streams();
  const common::Termination termination("surface_bridge");
  try {
    if (argc > 1 && is_command(argv[1])) return ask(argc, argv);
    if (argc > 1 && std::strcmp(argv[1], "calibrate") == 0) {
      const auto options = parse_calibrate(argc - 1, argv + 1);
      if (options) return calibrate(*options);
      return std::fflush(stdout) == 0 ? common::kDone : common::kFailed;
    }
    const auto options = parse(argc, argv);
    if (!options) return std::fflush(stdout) == 0 ? common::kDone : common::kFailed;
    return serve(*options);
  } catch (const std::invalid_argument& e) {
    common::print_error_line("surface_bridge: error", e.what());
    return common::kUserError;
  } catch (const shm_protocol::Error& e) {
    common::print_error_line("surface_bridge: error", e.what());
    return e.code() == shm_protocol::ErrorCode::kSystem ? common::kFailed : common::kUserError;
  } catch (const std::exception& e) {
    common::print_error_line("surface_bridge: error", common::failure_text(e));
    return common::kFailed;
  }
}
