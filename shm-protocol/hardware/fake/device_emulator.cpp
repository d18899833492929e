// device_emulator: the reference firmware on an emulated device, behind a pseudo-terminal or TCP, with
// configurable line faults.
#include <getopt.h>
#include <poll.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <thread>

#include "common/process/StandardStreams.h"
#include "shm-protocol/hardware/fake/EmulatedLine.h"
#include "shm-protocol/hardware/fake/NoisyLine.h"
#include "shm-protocol/hardware/fake/PillarDevice.h"
#include "shm-protocol/hardware/fake/ToyDevice.h"

namespace {

using hardware::NoisyLine;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr const char* kUsage =
    "usage: device_emulator --pty LINK | --tcp PORT [flags]\n"
    "A surface of real hardware, emulated for surface_bridge; prints the DEVICE to give it. The line gets "
    "worse:\n"
    "  --pty LINK       a pseudo-terminal, found through this symbolic link\n"
    "  --tcp PORT       a server on 127.0.0.1; 0: any free port\n"
    "  --device NAME    toy: discs that drift by themselves; pillars: a ball rolls on pillars with touch "
    "[toy]\n"
    "  --size WxH       cells, 1 to 1024 each way [16x16]\n"
    "  --period-ms N    control period [10]\n"
    "  --ticks N        end after N periods [never]\n"
    "  --once           end when the host has closed the line and not opened it again for a second\n"
    "  --drop P         probability that a byte is lost [0]\n"
    "  --corrupt P      probability that a byte is changed [0]\n"
    "  --delay-ms N     each piece comes up to N late [0]\n"
    "  --seed N         of the noise [1]\n"
    "  --silent-at N    say nothing from the Nth period on, for --silent-for N periods [50]\n"
    "  --unplug-at N    cut the line at the Nth period, for --unplug-for N periods [50]\n"
    "  --restart        the device starts anew while it is unplugged\n"
    "SIGUSR1 makes it silent, and SIGUSR2 cuts the line, from the next period on. At the end it prints its "
    "counts and the\n"
    "latency: from a sensor frame to the last byte of its answer.\n"
    "Exit status: 0 done, also on SIGINT and SIGTERM; 1 failed; 2 wrong input.\n";

std::atomic<bool> stop{false}, fall_silent{false}, cut{false};

struct Options {
  std::string link, device = "toy";
  int tcp = -1;
  std::uint16_t rows = 16, columns = 16;
  std::uint32_t period_ms = 10;
  std::uint64_t ticks = 0;
  hardware::NoiseOptions noise;
  std::uint64_t silent_at = 0, silent_for = 50, unplug_at = 0, unplug_for = 50;  // *_at 0: never
  bool once = false, restart = false, help = false;
};

template <class Number>
Number parse(const std::string& flag, const char* text, Number least, Number most) {
  Number value{};
  const char* end = text + std::strlen(text);
  const auto [next, error] = std::from_chars(text, end, value);
  if (error != std::errc{} || next != end || !(value >= least && value <= most))
    throw std::invalid_argument("--" + flag + ": '" + text + "' is not possible");
  return value;
}

void parse_size(const std::string& text, Options& o) {
  const std::size_t x = text.find('x');
  if (x == std::string::npos) throw std::invalid_argument("--size: '" + text + "' is not WxH");
  o.columns = parse<std::uint16_t>("size", text.substr(0, x).c_str(), 1, 1024);
  o.rows = parse<std::uint16_t>("size", text.substr(x + 1).c_str(), 1, 1024);
}

void set(const std::string& flag, Options& o) {
  const char* text = ::optarg;
  const auto count = [&] { return parse<std::uint64_t>(flag, text, 1, ~0ull); };
  if (flag == "pty") o.link = text;
  if (flag == "tcp") o.tcp = parse(flag, text, 0, 65535);
  if (flag == "device") o.device = text;
  if (flag == "size") parse_size(text, o);
  if (flag == "period-ms") o.period_ms = parse<std::uint32_t>(flag, text, 1, 60000);
  if (flag == "ticks") o.ticks = count();
  if (flag == "once") o.once = true;
  if (flag == "drop") o.noise.drop = parse(flag, text, 0.0, 1.0);
  if (flag == "corrupt") o.noise.corrupt = parse(flag, text, 0.0, 1.0);
  if (flag == "delay-ms") o.noise.delay = milliseconds(parse<unsigned>(flag, text, 0, 60000));
  if (flag == "seed") o.noise.seed = parse<std::uint64_t>(flag, text, 0, ~0ull);
  if (flag == "silent-at") o.silent_at = count();
  if (flag == "silent-for") o.silent_for = count();
  if (flag == "unplug-at") o.unplug_at = count();
  if (flag == "unplug-for") o.unplug_for = count();
  if (flag == "restart") o.restart = true;
  if (flag == "help") o.help = true;
}

Options parse(int argc, char** argv) {
  static const option kKnown[] = {
      {"pty", 1, nullptr, 1},       {"tcp", 1, nullptr, 1},        {"size", 1, nullptr, 1},
      {"device", 1, nullptr, 1},    {"period-ms", 1, nullptr, 1},  {"ticks", 1, nullptr, 1},
      {"drop", 1, nullptr, 1},      {"corrupt", 1, nullptr, 1},    {"delay-ms", 1, nullptr, 1},
      {"seed", 1, nullptr, 1},      {"silent-at", 1, nullptr, 1},  {"silent-for", 1, nullptr, 1},
      {"unplug-at", 1, nullptr, 1}, {"unplug-for", 1, nullptr, 1}, {"restart", 0, nullptr, 1},
      {"once", 0, nullptr, 1},      {"help", 0, nullptr, 1},       {nullptr, 0, nullptr, 0}};
  Options o;
  for (int index = 0, flag; (flag = ::getopt_long(argc, argv, "", kKnown, &index)) != -1;) {
    if (flag != 1) throw std::invalid_argument("see --help");
    set(kKnown[index].name, o);
  }
  if (o.help) return o;
  if (o.device != "toy" && o.device != "pillars")
    throw std::invalid_argument("--device: '" + o.device + "' must be toy or pillars");
  if (::optind != argc || o.link.empty() == (o.tcp < 0))
    throw std::invalid_argument("either --pty LINK or --tcp PORT is needed; see --help");
  return o;
}

class Emulator {
 public:
  explicit Emulator(const Options& o)
      : o_(o),
        line_(o.tcp < 0 ? hardware::EmulatedLine::terminal(o.link)
                        : hardware::EmulatedLine::tcp(static_cast<std::uint16_t>(o.tcp))),
        from_host_(o.noise),
        to_host_(other_seed(o.noise)),
        device_(make_device()) {}

  void run() {
    std::printf("device %s\n", line_.name().c_str());
    std::fflush(stdout);
    while (!stop.load() && (o_.ticks == 0 || period_ < o_.ticks) && !(o_.once && host_has_left())) {
      wait();
      carry();
      if (now() >= milliseconds(o_.period_ms) * (period_ + 1)) next_period();
    }
    std::printf("periods %llu dropped %llu corrupted %llu missed %u\n",
                static_cast<unsigned long long>(period_),
                static_cast<unsigned long long>(from_host_.dropped + to_host_.dropped),
                static_cast<unsigned long long>(from_host_.corrupted + to_host_.corrupted),
                device_->firmware().missed);
    print_latency();
    if (distance_count_ > 0)
      std::printf("ball distance_cm %.2f\n", distance_sum_ / static_cast<double>(distance_count_));
  }

 private:
  static constexpr std::size_t kMaxLatencies = 10'000'000;
  static constexpr double kSettled_s = 4.0;  // after the ball was placed

  std::unique_ptr<hardware::EmulatedDevice> make_device() {
    auto write = [this](const std::uint8_t* bytes, std::size_t count) {
      if (!silent()) to_host_.send(bytes, count, now());
    };
    const std::uint32_t period_us = o_.period_ms * 1000;
    if (o_.device == "toy")
      return std::make_unique<hardware::ToyDevice>(o_.rows, o_.columns, period_us, write);
    auto pillars = std::make_unique<hardware::PillarDevice>(o_.rows, o_.columns, period_us, write);
    pillars_ = pillars.get();
    return pillars;
  }

  void print_latency() {
    if (latency_us_.empty()) return;
    std::ranges::sort(latency_us_);
    const auto quantile = [&](double share) {
      return latency_us_[static_cast<std::ptrdiff_t>(share * static_cast<double>(latency_us_.size() - 1))];
    };
    std::printf("answers %zu latency_us median %u p99 %u max %u\n", latency_us_.size(), quantile(0.5),
                quantile(0.99), quantile(1.0));
  }

  // Records the latency of the answer to this period's frame, once the answer is complete.
  void measure_latency() {
    const ssd_device& firmware = device_->firmware();
    if (firmware.ready_tick != firmware.tick || answered_tick_ == firmware.tick) return;
    answered_tick_ = firmware.tick;
    const auto latency = std::chrono::duration_cast<std::chrono::microseconds>(now() - sent_at_);
    if (latency_us_.size() < kMaxLatencies)
      latency_us_.push_back(static_cast<std::uint32_t>(latency.count()));
  }

  static hardware::NoiseOptions other_seed(hardware::NoiseOptions noise) {
    noise.seed += 0x9E3779B97F4A7C15u;
    return noise;
  }
  NoisyLine::Time now() const { return Clock::now() - start_; }
  bool within(std::uint64_t at, std::uint64_t length) const {
    return at != 0 && period_ >= at && period_ < at + length;
  }
  bool silent() const { return within(o_.silent_at, o_.silent_for); }

  // Returns whether the host closed the line and did not open it again within a second.
  bool host_has_left() const { return host_seen_at_ && now() > *host_seen_at_ + std::chrono::seconds(1); }

  void wait() {
    NoisyLine::Time until = milliseconds(o_.period_ms) * (period_ + 1);
    for (const NoisyLine* line : {&from_host_, &to_host_})
      if (const auto due = line->next_arrival()) until = std::min(until, *due);
    const auto left = std::chrono::ceil<milliseconds>(until - now());
    pollfd line{line_.descriptor(), POLLIN, 0};
    const int wait_ms = static_cast<int>(std::max<milliseconds::rep>(left.count(), 0));
    // A pseudo-terminal that no process has opened reports a hang-up immediately.
    if (::poll(&line, 1, wait_ms) == 1 && !(line.revents & POLLIN))
      std::this_thread::sleep_for(milliseconds(std::min(wait_ms, 1)));
  }

  void carry() {
    bytes_.clear();
    line_.read(bytes_);
    if (line_.has_host() || (host_seen_at_ && !line_.plugged())) host_seen_at_ = now();
    if (!bytes_.empty()) from_host_.send(bytes_.data(), bytes_.size(), now());
    bytes_.clear();
    from_host_.receive(now(), bytes_);
    for (const std::uint8_t byte : bytes_) {
      device_->receive(byte);
      measure_latency();
    }
    bytes_.clear();
    to_host_.receive(now(), bytes_);
    line_.write(bytes_);
  }

  void next_period() {
    ++period_;
    if (fall_silent.exchange(false)) o_.silent_at = period_;
    if (cut.exchange(false)) o_.unplug_at = period_;
    if (within(o_.unplug_at, o_.unplug_for)) {
      line_.unplug();
      from_host_.clear();
      to_host_.clear();
      if (o_.restart && period_ == o_.unplug_at) device_->restart();
    } else {
      line_.plug();
    }
    sent_at_ = now();
    device_->period();
    if (pillars_ && pillars_->seconds_since_placed() > kSettled_s) {
      distance_sum_ += pillars_->distance();
      ++distance_count_;
    }
  }

  Options o_;
  Clock::time_point start_ = Clock::now();
  std::uint64_t period_ = 0;
  hardware::EmulatedLine line_;
  NoisyLine from_host_, to_host_;
  hardware::PillarDevice* pillars_ = nullptr;  // device_, if it is one
  std::unique_ptr<hardware::EmulatedDevice> device_;
  std::vector<std::uint8_t> bytes_;
  std::optional<NoisyLine::Time> host_seen_at_;  // last; moves on while the line is unplugged
  NoisyLine::Time sent_at_{};                    // when the last sensor frame was sent
  std::uint32_t answered_tick_ = 0;              // tick whose latency was measured last
  std::vector<std::uint32_t> latency_us_;
  double distance_sum_ = 0.0;  // of the settled ball from the middle, cm
  std::uint64_t distance_count_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  common::open_standard_streams();
  try {
    const Options o = parse(argc, argv);
    if (o.help) {
      std::fputs(kUsage, stdout);
      return 0;
    }
    struct sigaction action {};
    action.sa_handler = [](int number) {
      (number == SIGUSR1 ? fall_silent : number == SIGUSR2 ? cut : stop).store(true);
    };
    for (const int number : {SIGINT, SIGTERM, SIGUSR1, SIGUSR2}) sigaction(number, &action, nullptr);
    std::make_unique<Emulator>(o)->run();
    return 0;
  } catch (const std::invalid_argument& e) {
    std::fprintf(stderr, "device_emulator: error: %s\n", e.what());
    return 2;
  } catch (const std::runtime_error& e) {
    std::fprintf(stderr, "device_emulator: error: %s\n", e.what());
    return 1;
  }
}
