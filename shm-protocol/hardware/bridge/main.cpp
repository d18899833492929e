// surface_bridge: the surface role for a physical device on a serial line or behind TCP.
#include <getopt.h>
#include <shm_protocol/Error.h>
#include <unistd.h>

#include <atomic>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <exception>
#include <new>
#include <stdexcept>

#include "shm-protocol/hardware/bridge/Bridge.h"

namespace {

using hardware::Bridge;
using hardware::BridgeOptions;
using std::chrono::milliseconds;

enum ExitStatus { kDone = 0, kFailed = 1, kWrongInput = 2, kDeviceLost = 3, kSignalled = 128 };

constexpr const char* kUsage =
    "usage: surface_bridge DEVICE [flags]\n"
    "The surface role for a physical device. DEVICE is a serial line (/dev/ttyUSB0) or tcp:HOST:PORT; the "
    "device\n"
    "describes itself, and its clock drives the session (docs/hardware.md).\n"
    "  --baud N         speed of a serial line [115200]\n"
    "  --shm NAME       name for controllers to attach to [surface]\n"
    "  --mode MODE      time-step (one answer to each sensor frame) or passive (whoever is ready) "
    "[time-step]\n"
    "  --ticks N        end after N sensor frames [never]\n"
    "  --silence S      seconds without a sensor frame after which the device is silent [0.5]\n"
    "  --connect S      seconds to wait for the device at the start [10]\n"
    "  --replug S       seconds to wait for a device that was lost [for ever]\n"
    "  --hold           without a controller the device keeps the last frame [it gets the safe values]\n"
    "Exit status: 0 done; 1 failed; 2 wrong input; 3 the device did not come, or not come back; 128 + n "
    "after\n"
    "signal n.\n";

std::atomic<bool> stop{false};
std::atomic<int> signal_number{0};

// A supervisor signals the process and its group: signals within half a second are one request. A later one
// ends the process at once.
void on_signal(int number) {
  static std::atomic<std::int64_t> first_ns{0};
  struct timespec time {};
  ::clock_gettime(CLOCK_MONOTONIC, &time);
  const std::int64_t now_ns = std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
  std::int64_t expected = 0;
  if (!first_ns.compare_exchange_strong(expected, now_ns)) {
    if (now_ns - expected >= 500'000'000) ::_exit(kSignalled + number);
    return;
  }
  signal_number.store(number);
  stop.store(true);
}

void catch_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // nohup ignores SIGHUP so that the bridge survives its terminal; leave it ignored.
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN)
    sigaction(SIGHUP, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

template <class Number>
Number parse(const char* flag, const char* text, Number least, Number most, const char* what) {
  Number value{};
  const char* end = text + std::strlen(text);
  const auto [next, error] = std::from_chars(text, end, value);
  if (error != std::errc{} || next != end || !(value >= least && value <= most))
    throw std::invalid_argument(std::string("--") + flag + ": '" + text + "' is not " + what);
  return value;
}

milliseconds parse_seconds(const char* flag, const char* text) {
  const double s = parse(flag, text, 0.001, 1e6, "a time in seconds from 0.001 to 1000000");
  return std::chrono::duration_cast<milliseconds>(std::chrono::duration<double>(s));
}

shm_protocol::Mode parse_mode(const std::string& text) {
  if (text == "time-step") return shm_protocol::Mode::kTimeStep;
  if (text == "passive") return shm_protocol::Mode::kPassive;
  throw std::invalid_argument("--mode: '" + text + "' is neither time-step nor passive");
}

// Returns nothing if --help was requested and printed.
std::optional<BridgeOptions> parse(int argc, char** argv) {
  static const option kKnown[] = {{"baud", 1, nullptr, 'b'},    {"shm", 1, nullptr, 's'},
                                  {"mode", 1, nullptr, 'm'},    {"ticks", 1, nullptr, 't'},
                                  {"silence", 1, nullptr, 'q'}, {"connect", 1, nullptr, 'c'},
                                  {"replug", 1, nullptr, 'r'},  {"hold", 0, nullptr, 'o'},
                                  {"help", 0, nullptr, 'h'},    {nullptr, 0, nullptr, 0}};
  BridgeOptions o;
  unsigned baud = 115200;
  for (int flag; (flag = ::getopt_long(argc, argv, "h", kKnown, nullptr)) != -1;) {
    switch (flag) {
      case 'b':
        baud = parse("baud", ::optarg, 1u, 10'000'000u, "a speed in bits a second");
        break;
      case 's':
        o.surface = ::optarg;
        break;
      case 'm':
        o.mode = parse_mode(::optarg);
        break;
      case 't':
        o.ticks = parse<std::uint64_t>("ticks", ::optarg, 1, ~0ull, "a whole number from 1");
        break;
      case 'q':
        o.silence_timeout = parse_seconds("silence", ::optarg);
        break;
      case 'c':
        o.connect_timeout = parse_seconds("connect", ::optarg);
        break;
      case 'r':
        o.reconnect_timeout = parse_seconds("replug", ::optarg);
        break;
      case 'o':
        o.hold_last_frame = true;
        break;
      case 'h':
        std::fputs(kUsage, stdout);
        return std::nullopt;
      default:
        throw std::invalid_argument("see --help");
    }
  }
  if (::optind + 1 != argc)
    throw std::invalid_argument("one DEVICE is needed: a serial line or tcp:HOST:PORT");
  o.port = hardware::PortAddress::parse(argv[::optind], baud);
  return o;
}

void print(const hardware::BridgeCounters& c) {
  const auto n = [](std::uint64_t value) { return static_cast<unsigned long long>(value); };
  std::printf(
      "frames %llu answers %llu lost %llu passed_over %llu missed %llu unsent %llu silences %llu "
      "reconnections %llu "
      "damaged_packets %llu lost_packets %llu\n",
      n(c.frames), n(c.answers), n(c.lost), n(c.skipped), n(c.missed_deadlines), n(c.unsent), n(c.silences),
      n(c.reconnections), n(c.damaged_packets), n(c.lost_packets));
}

int serve(const BridgeOptions& options) {
  Bridge bridge(options, stop,
                [](const std::string& line) { std::fprintf(stderr, "surface_bridge: %s\n", line.c_str()); });
  const hardware::Outcome end = bridge.run();
  print(bridge.counters());
  if (std::fflush(stdout) != 0) return kFailed;
  switch (end) {
    case hardware::Outcome::kDone:
      return kDone;
    case hardware::Outcome::kStopped:
      return kSignalled + signal_number.load();
    case hardware::Outcome::kDeviceLost:
      return kDeviceLost;
    case hardware::Outcome::kFailed:
      break;
  }
  return kFailed;
}

}  // namespace

int main(int argc, char** argv) {
  // Without memory not even an exception can be thrown.
  std::set_terminate([] {
    try {
      if (std::current_exception()) throw;
      if (std::malloc(4096) != nullptr) std::abort();
    } catch (const std::bad_alloc&) {
    } catch (...) {
      std::abort();
    }
    std::fputs("surface_bridge: error: there is not enough memory\n", stderr);
    std::_Exit(kFailed);
  });
  try {
    const auto options = parse(argc, argv);
    if (!options) return std::fflush(stdout) == 0 ? kDone : kFailed;
    catch_signals();
    return serve(*options);
  } catch (const std::invalid_argument& e) {
    std::fprintf(stderr, "surface_bridge: error: %s\n", e.what());
    return kWrongInput;
  } catch (const shm_protocol::Error& e) {
    std::fprintf(stderr, "surface_bridge: error: %s\n", e.what());
    return e.code() == shm_protocol::ErrorCode::kSystem ? kFailed : kWrongInput;
  } catch (const std::bad_alloc&) {
    std::fputs("surface_bridge: error: there is not enough memory\n", stderr);
    return kFailed;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "surface_bridge: error: %s\n", e.what());
    return kFailed;
  }
}
