// surface_bridge: the surface role for a physical device on a serial line or behind TCP.
#include <getopt.h>
#include <shm_protocol/Error.h>
#include <unistd.h>

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <stdexcept>

#include "common/process/ExitStatus.h"
#include "common/process/StandardStreams.h"
#include "common/process/StopSignals.h"
#include "common/process/Termination.h"
#include "common/text/Printable.h"
#include "shm-protocol/hardware/bridge/Bridge.h"

namespace {

using hardware::Bridge;
using hardware::BridgeOptions;
using std::chrono::milliseconds;

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
  Bridge bridge(options, common::catch_stop_signals(),
                [](const std::string& line) { common::print_error_line("surface_bridge", line); });
  const hardware::Outcome end = bridge.run();
  print(bridge.counters());
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

}  // namespace

int main(int argc, char** argv) {
  common::open_standard_streams();
  const common::Termination termination("surface_bridge");
  try {
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
