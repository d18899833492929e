// shm_dump: shows the data in a surface's shared memory, lists surfaces, removes segments of dead ones.
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <stdexcept>
#include <thread>

#include "Report.h"
#include "common/cli/Flags.h"
#include "common/process/ExitStatus.h"
#include "common/process/StandardStreams.h"
#include "common/process/StopSignals.h"
#include "common/process/Termination.h"
#include "common/text/Number.h"
#include "common/text/Printable.h"
#include "common/text/Words.h"

namespace {

using namespace shm_protocol;
using namespace std::chrono_literals;
using dump::SurfaceStatus;

constexpr const char* kHelp = R"(shm_dump - show the shared memory between a surface and its controller

  shm_dump NAME [options]    header, channels, states, counters and rates of surface NAME
  shm_dump --list            all surfaces of this machine, living and dead
  shm_dump --clean[=PREFIX]  remove the segments that dead surfaces left (their owners are
                             checked first); with PREFIX only those with this prefix

  -n, --numbers              the arrays of the newest frames, as numbers
  -m, --map                  the same as heat maps
  -c, --channel CHANNEL      only this channel's array (repeatable); implies --map
                             unless --numbers is given
  -a, --all                  large arrays of numbers in full
  -f, --follow[=SECONDS]     repeat every SECONDS (default: 0.5) until the surface ends
  -k, --count N              with --follow: stop after N times
  -w, --wait SECONDS         how long to wait for the surface to appear
      --colour=WHEN          auto (default), always, never
  -j, --json                 JSON; with --follow one object a line
  -h, --help                 this text
  -V, --version              version

It maps the segment read-only and never slows or disturbs either side.
Exit status: 0 done, 1 failed, 2 wrong input, 3 no such surface, or it died, 128 + n after
signal n.
)";

struct Options {
  std::string name, clean_prefix, colour = "auto";
  bool list = false, clean = false, json = false, follow = false;
  double interval_s = 0.5, wait_s = 0;
  long count = 0;  // 0: unlimited
  dump::Format format;
};

struct UserError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

double parse_number(const char* option, const char* text, double minimum) {
  double value = 0;
  // Written so that a NaN fails.
  if (!common::parse_number(text, value) || !(value >= minimum && value <= 1e9))
    throw UserError(std::string(option) + " " + text + ": must be a number from " +
                    (minimum == 1   ? "1"
                     : minimum == 0 ? "0"
                                    : "0.001") +
                    " to 1e9");
  return value;
}

// Returns nothing if --help or --version was requested and printed.
std::optional<Options> parse(int argc, char** argv) {
  Options o;
  ::opterr = 0;
  const auto show = [&](dump::ArrayDisplay arrays) {
    return [&o, arrays](const char*) { o.format.arrays = arrays; };
  };
  const std::string_view stopped_at = common::read_flags(
      argc, argv,
      {{"list", no_argument, [&](const char*) { o.list = true; }},
       {"clean", optional_argument,
        [&](const char* prefix) {
          if (prefix != nullptr && *prefix == '\0')
            throw UserError("--clean=: must be the beginning of a name; without one, all are removed");
          o.clean = true, o.clean_prefix = prefix ? prefix : "";
        }},
       {"numbers", no_argument, show(dump::ArrayDisplay::kNumbers), 'n'},
       {"map", no_argument, show(dump::ArrayDisplay::kMap), 'm'},
       {"channel", required_argument, [&](const char* name) { o.format.channels.emplace_back(name); }, 'c'},
       {"all", no_argument, [&](const char*) { o.format.all_numbers = true; }, 'a'},
       {"follow", optional_argument,
        [&](const char* interval) {
          o.follow = true;
          if (interval) o.interval_s = parse_number("--follow", interval, 0.001);
        },
        'f'},
       {"count", required_argument,
        [&](const char* text) { o.count = static_cast<long>(parse_number("--count", text, 1)); }, 'k'},
       {"wait", required_argument, [&](const char* text) { o.wait_s = parse_number("--wait", text, 0); },
        'w'},
       {"colour", required_argument, [&](const char* when) { o.colour = when; }},
       {"json", no_argument, [&](const char*) { o.json = true; }, 'j'},
       {"help", no_argument, nullptr, 'h'},
       {"version", no_argument, nullptr, 'V'}});
  if (stopped_at == "?")
    throw UserError(std::string(argv[optind - 1]) +
                    ": not an option, or it lacks its value; see shm_dump --help");
  if (!stopped_at.empty()) {
    std::fputs(stopped_at == "help" ? kHelp : "shm_dump " SMARTSURF_VERSION "\n", stdout);
    return std::nullopt;
  }
  if (optind < argc) o.name = argv[optind++];
  if (optind < argc) throw UserError(std::string(argv[optind]) + ": one surface at a time");
  if (o.list + o.clean + !o.name.empty() != 1)
    throw UserError("give the name of a surface, or --list, or --clean; see shm_dump --help");
  if (o.count && !o.follow) throw UserError("--count: only with --follow");
  if (o.colour != "auto" && o.colour != "always" && o.colour != "never")
    throw UserError("--colour " + o.colour + ": must be auto, always or never");
  if (!o.format.channels.empty() && o.format.arrays == dump::ArrayDisplay::kNone)
    o.format.arrays = dump::ArrayDisplay::kMap;
  return o;
}

void fit_to_terminal(Options& o) {
  const bool terminal = ::isatty(STDOUT_FILENO) != 0;
  const char* no_colour = std::getenv("NO_COLOR");
  o.format.colour = o.colour == "always" || (o.colour == "auto" && terminal && !(no_colour && *no_colour));
  winsize size{};
  if (terminal && ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col >= 40)
    o.format.width = std::min<int>(size.ws_col, 256);
}

void check_channels(const Options& o, const Description& d) {
  for (const std::string& wanted : o.format.channels)
    if (d.channel(Direction::kSensor, wanted) < 0 && d.channel(Direction::kActuator, wanted) < 0)
      throw UserError(
          "--channel " + wanted + ": surface " + common::printable(d.name) + " has " +
          common::join(d.channels, [](const ChannelSpec& c) { return common::printable(c.name); }));
}

// Reads the newest frames; returns whether the surface has ended.
Status sample(ObserverEndpoint& observer, SurfaceStatus& status) {
  status.description = &observer.description();
  const Status sensors = observer.latest(Direction::kSensor),
               actuators = observer.latest(Direction::kActuator);
  status.sensors_torn = sensors == Status::kTorn;
  status.actuators_torn = actuators == Status::kTorn;
  status.sensors = observer.info(Direction::kSensor);
  status.actuators = observer.info(Direction::kActuator);
  status.surface = observer.surface_state();
  status.controller = observer.controller_state();
  status.controller_pid = observer.controller_pid();
  status.controllers_seen = observer.controllers_seen();
  status.surface_counters = observer.surface_counters();
  status.controller_counters = observer.controller_counters();
  if (status.surface == State::kDead) return Status::kSurfaceDead;
  return status.surface == State::kClosing ? Status::kSurfaceClosed : Status::kOk;
}

class RateMeter {
 public:
  explicit RateMeter(const ObserverEndpoint& observer) : observer_(observer) { restart(); }
  dump::Rates read() {
    const auto sensors = sensors_, actuators = actuators_;
    const auto since = since_;
    restart();
    const double s = std::max(1e-9, std::chrono::duration<double>(since_ - since).count());
    return {static_cast<std::uint32_t>(sensors_ - sensors) / s,
            static_cast<std::uint32_t>(actuators_ - actuators) / s};
  }

 private:
  void restart() {
    since_ = std::chrono::steady_clock::now();
    sensors_ = observer_.published(Direction::kSensor);
    actuators_ = observer_.published(Direction::kActuator);
  }
  const ObserverEndpoint& observer_;
  std::chrono::steady_clock::time_point since_;
  std::uint32_t sensors_ = 0, actuators_ = 0;
};

void pause_for(double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!common::stop_flag() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(
        std::min<std::chrono::duration<double>>(50ms, end - std::chrono::steady_clock::now()));
}

int show(Options& o) {
  const auto wait =
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(o.wait_s));
  auto observer = ObserverEndpoint::attach(o.name, {.timeout = wait, .stop = &common::stop_flag()});
  check_channels(o, observer.description());
  RateMeter meter(observer);
  const bool repaint = o.follow && !o.json && ::isatty(STDOUT_FILENO) != 0;
  for (long samples = 1;; ++samples) {
    pause_for(o.follow ? (samples == 1 ? 0.0 : o.interval_s) : 0.1);
    SurfaceStatus status;
    const Status ended = sample(observer, status);
    if (samples > 1 || !o.follow) status.rates = meter.read();
    if (repaint) std::fputs("\033[H\033[2J", stdout);
    common::print_output(o.json ? dump::json_report(status, observer, o.format, o.follow)
                                : dump::text_report(status, observer, o.format));
    if (o.follow && !o.json && !repaint) std::fputs("\n", stdout);
    if (std::fflush(stdout) != 0) return common::kFailed;
    if (ended != Status::kOk) {
      common::print_error_line("shm_dump", o.name + ": " + text(ended));
      return ended == Status::kSurfaceDead ? common::kPeerLost : common::kDone;
    }
    if (!o.follow || common::stop_flag() || (o.count && samples >= o.count)) return common::kDone;
  }
}

int list(const Options& o) {
  const auto segments = list_segments();
  common::print_output(o.json ? dump::json_list(segments) : dump::text_list(segments));
  return common::kDone;
}

int clean(const Options& o) {
  const auto removed = remove_orphans(o.clean_prefix);
  if (o.json) {
    common::print_output(dump::json_list(removed));
    return common::kDone;
  }
  for (const SegmentInfo& s : removed)
    std::printf("removed %s: process %u is gone\n", common::printable(s.name).c_str(), s.surface_pid);
  if (removed.empty()) std::puts("nothing to remove");
  return common::kDone;
}

int exit_status_of(const Error& e) {
  switch (e.code()) {
    case ErrorCode::kNotFound:
      return common::kPeerLost;
    case ErrorCode::kBadConfig:
    case ErrorCode::kForeign:
      return common::kUserError;
    default:
      return common::kFailed;
  }
}

}  // namespace

int main(int argc, char** argv) {
  common::open_standard_streams();
  const common::Termination termination("shm_dump");
  common::catch_stop_signals();
  try {
    std::optional<Options> o = parse(argc, argv);
    if (o) fit_to_terminal(*o);
    const int status = !o ? common::kDone : o->list ? list(*o) : o->clean ? clean(*o) : show(*o);
    if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return common::status_after_signals(status);
    common::print_error_line("shm_dump", "cannot write the output");
    return common::kFailed;
  } catch (const UserError& e) {
    common::print_error_line("shm_dump", e.what());
    return common::kUserError;
  } catch (const std::invalid_argument& e) {
    common::print_error_line("shm_dump", e.what());
    return common::kUserError;
  } catch (const Error& e) {
    if (e.code() == ErrorCode::kInterrupted) return common::status_after_signals(common::kDone);
    common::print_error_line("shm_dump", e.what());
    return exit_status_of(e);
  } catch (const std::exception& e) {
    common::print_error_line("shm_dump", common::failure_text(e));
    return common::kFailed;
  }
}
