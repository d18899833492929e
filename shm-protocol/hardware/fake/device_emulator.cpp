// device_emulator: the reference firmware on an emulated device, behind a pseudo-terminal or TCP, with
// configurable line faults.
#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <thread>

#include "common/cli/Flags.h"
#include "common/files/AtomicFile.h"
#include "common/process/StandardStreams.h"
#include "common/text/Number.h"
#include "common/text/Words.h"
#include "shm-protocol/hardware/fake/EmulatedBoard.h"
#include "shm-protocol/hardware/fake/PillarDevice.h"
#include "shm-protocol/hardware/fake/ToyDevice.h"
#include "shm-protocol/hardware/fake/World.h"

namespace {

using hardware::EmulatedBoard;
using std::chrono::milliseconds;

constexpr const char* kUsage =
    "usage: device_emulator --pty LINK | --tcp PORT [flags]\n"
    "Boards of a surface, emulated for surface_bridge; prints the DEVICE of each.\n"
    "  --pty LINK       a pseudo-terminal, found through this symbolic link, which replaces no file; of "
    "several boards,\n"
    "                   LINK-0, LINK-1, …\n"
    "  --tcp PORT       a server on 127.0.0.1; of several boards, on successive ports; 0: any free ports\n"
    "  --device NAME    toy: discs that drift by themselves; pillars: a ball rolls on pillars with touch "
    "[toy]\n"
    "  --world NAME     instead of a device: the surface NAME of a simulator, in time-step mode, lies under "
    "the "
    "boards. It\n"
    "                   begins with the host's first frame; its period and channels are the boards'\n"
    "  --size WxH       cells of a board, 1 to 1024 each way [16x16]\n"
    "  --boards WxH     boards of the table, 1 to 64 each way [1x1]\n"
    "  --table FILE     write the table for surface_bridge --table, of the name --name [table]\n"
    "  --period-ms N    control period, 0.5 to 60000 [10]\n"
    "  --ticks N        end after N periods of the first board [never]\n"
    "  --patient        a period is prolonged by whole periods until the host has answered, up to twelve, "
    "and nothing\n"
    "                   becomes safe meanwhile: the load of this machine does not count\n"
    "  --once           end when the host has closed every line and not opened it again for a second\n"
    "  --pins FILE      keep the first board's active heights in FILE, one byte per cell\n"
    "The boards:\n"
    "  --slew V, --acceleration A, --soft-start V, --most-moving N    limits of the height [none]\n"
    "  --drift-ppm N    each clock is up to N millionths fast or slow [0]\n"
    "  --version-1      the boards speak version 1 of the byte protocol only\n"
    "  --queue BYTES    for the host; a full queue drops sensor frames [65536]\n"
    "  --blocking       writes wait for the host, as firmware must not\n"
    "  --errors SEED    toy: each cell has zero, slope, dead band, speeds, lag, delay and sensor of its own, "
    "some "
    "are stuck or dead\n"
    "  --truth FILE     write these secrets: row, column, zero, slope, play, speeds up and down, lag, delay, "
    "zero "
    "and noise of the sensor, state\n"
    "  --stop-at N      press the first board's emergency stop in its Nth period\n"
    "The line gets worse:\n"
    "  --drop P         probability that a byte is lost [0]\n"
    "  --corrupt P      probability that a byte is changed [0]\n"
    "  --delay-ms N     each piece comes up to N late [0]\n"
    "  --seed N         of noise, clocks and storm [1]\n"
    "  --silent-at N    say nothing from the Nth period on, for --silent-for N periods [50]\n"
    "  --unplug-at N    cut the line at the Nth period, for --unplug-for N periods [50]\n"
    "  --restart        the device restarts as it falls silent or is unplugged\n"
    "  --storm N        N times a second, unplug, restart, silence or disturb a random board\n"
    "SIGUSR1 makes the first board silent, and SIGUSR2 cuts its line, from the next period on. A timer "
    "interrupt runs the\n"
    "watchdog. At the end the emulator prints its counts and the latency: from a sensor frame to the last "
    "byte of its "
    "answer.\n"
    "Exit status: 0 done, also on SIGINT and SIGTERM; 1 failed; 2 wrong input.\n";

std::atomic<bool> stop{false}, fall_silent{false}, cut{false};

struct Options {
  std::string device, table, name = "table", pins, world;
  hardware::EmulatedBoardOptions board;
  std::uint16_t rows = 16, columns = 16, board_rows = 1, board_columns = 1;
  std::uint64_t ticks = 0, stop_at = 0;
  std::optional<ssw_limits> limits;
  std::optional<std::uint64_t> errors;
  std::string truth;
  double drift_ppm = 0, storm = 0;
  bool once = false, patient = false, help = false, has_period = false;
};

template <class Number>
Number parse(const std::string& flag, const char* text, Number least, Number most) {
  Number value{};
  if (!common::parse_number(text, value) || !(value >= least && value <= most))
    throw std::invalid_argument("--" + flag + ": '" + text + "' is not possible");
  return value;
}

void parse_size(const std::string& flag, const std::string& text, unsigned most, std::uint16_t& rows,
                std::uint16_t& columns) {
  const std::size_t x = text.find('x');
  if (x == std::string::npos) throw std::invalid_argument("--" + flag + ": '" + text + "' is not WxH");
  columns = parse<std::uint16_t>(flag, text.substr(0, x).c_str(), 1, static_cast<std::uint16_t>(most));
  rows = parse<std::uint16_t>(flag, text.substr(x + 1).c_str(), 1, static_cast<std::uint16_t>(most));
}

Options parse(int argc, char** argv) {
  Options o;
  hardware::EmulatedBoardOptions& b = o.board;
  std::vector<common::Flag> flags{{"help", no_argument, [&](const char*) { o.help = true; }}};
  const auto add = [&](const char* name, auto read) { flags.push_back({name, required_argument, read}); };
  const auto add_switch = [&](const char* name, bool& is_on) {
    flags.push_back({name, no_argument, [&](const char*) { is_on = true; }});
  };
  const auto add_text = [&](const char* name, std::string& value) {
    add(name, [&](const char* text) { value = text; });
  };
  const auto add_number = [&](const char* name, auto least, auto most, auto& value) {
    add(name, [=, &value](const char* text) { value = parse(name, text, least, most); });
  };
  constexpr std::uint64_t kAny = ~std::uint64_t{0};
  const auto add_count = [&](const char* name, std::uint64_t& value) {
    add_number(name, std::uint64_t{1}, kAny, value);
  };
  ssw_limits limits{};
  add_text("pty", b.link);
  add_number("tcp", 0, 65535, b.tcp);
  add_text("device", o.device);
  add("size", [&](const char* text) { parse_size("size", text, 1024, o.rows, o.columns); });
  add("boards", [&](const char* text) { parse_size("boards", text, 64, o.board_rows, o.board_columns); });
  add_text("table", o.table);
  add_text("name", o.name);
  add_text("pins", o.pins);
  add_text("world", o.world);
  add("period-ms", [&](const char* text) {
    b.period_us = static_cast<std::uint32_t>(parse("period-ms", text, 0.5, 60000.0) * 1e3 + 0.5);
    o.has_period = true;
  });
  add_count("ticks", o.ticks);
  add_switch("once", o.once);
  add_switch("patient", o.patient);
  add_number("slew", 1e-6F, 1e9F, limits.slew);
  add_number("acceleration", 1e-6F, 1e9F, limits.acceleration);
  add_number("soft-start", 1e-6F, 1e9F, limits.soft_start);
  add_number("most-moving", std::uint16_t{1}, std::uint16_t{65535}, limits.most_moving);
  add_number("drift-ppm", 0.0, 10000.0, o.drift_ppm);
  add_switch("version-1", b.version_1);
  add_number("queue", std::size_t{0}, std::size_t{1} << 30, b.queue_bytes);
  add_switch("blocking", b.blocking);
  add_number("errors", std::uint64_t{0}, kAny, o.errors);
  add_text("truth", o.truth);
  add_count("stop-at", o.stop_at);
  add_number("drop", 0.0, 1.0, b.noise.drop);
  add_number("corrupt", 0.0, 1.0, b.noise.corrupt);
  add("delay-ms",
      [&](const char* text) { b.noise.delay = milliseconds(parse<unsigned>("delay-ms", text, 0, 60000)); });
  add_number("seed", std::uint64_t{0}, kAny, b.noise.seed);
  add_count("silent-at", b.silent_at);
  add_count("silent-for", b.silent_for);
  add_count("unplug-at", b.unplug_at);
  add_count("unplug-for", b.unplug_for);
  add_switch("restart", b.restarts);
  add_number("storm", 0.0, 1000.0, o.storm);
  if (!common::read_flags(argc, argv, flags).empty()) throw std::invalid_argument("see --help");
  if (limits.slew > 0 || limits.acceleration > 0 || limits.soft_start > 0 || limits.most_moving > 0)
    o.limits = limits;
  if (o.help) return o;
  if (!o.world.empty() && !(o.device.empty() && o.pins.empty() && !o.errors && !o.has_period))
    throw std::invalid_argument("--world: the surface '" + o.world +
                                "' takes the place of --device, --errors, "
                                "--pins and --period-ms");
  if (const int last = b.tcp + o.board_rows * o.board_columns - 1; b.tcp > 0 && last > 65535)
    throw std::invalid_argument("--tcp: " + std::to_string(o.board_rows * o.board_columns) +
                                " boards from port " + std::to_string(b.tcp) + " need port " +
                                std::to_string(last) + ", but the last is 65535");
  if (o.device.empty()) o.device = "toy";
  if (o.device != "toy" && o.device != "pillars")
    throw std::invalid_argument("--device: '" + o.device + "' must be toy or pillars");
  if (o.errors && o.device != "toy") throw std::invalid_argument("--errors needs --device toy");
  if (!o.truth.empty() && !o.errors) throw std::invalid_argument("--truth needs --errors SEED");
  if (::optind != argc || o.board.link.empty() == (o.board.tcp < 0))
    throw std::invalid_argument("either --pty LINK or --tcp PORT is needed; see --help");
  return o;
}

// The boards that the timer interrupt watches.
std::vector<std::unique_ptr<EmulatedBoard>> boards;
EmulatedBoard::Time last_interrupt{};

void interrupt(int) {
  const int error = errno;
  const EmulatedBoard::Time now = EmulatedBoard::now();
  const auto elapsed = std::chrono::duration_cast<std::chrono::microseconds>(now - last_interrupt);
  last_interrupt = now;
  for (const auto& board : boards) board->device().watchdog(static_cast<std::uint32_t>(elapsed.count()));
  errno = error;
}

// The bytes of a file, mapped to memory until the process ends.
std::uint8_t* map_file(const std::string& path, std::size_t bytes) {
  const int file = ::open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600);
  void* memory = MAP_FAILED;
  if (file >= 0 && ::ftruncate(file, static_cast<off_t>(bytes)) == 0)
    memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (file >= 0) ::close(file);
  if (memory == MAP_FAILED) throw std::runtime_error("cannot write " + path + ": " + std::strerror(errno));
  return static_cast<std::uint8_t*>(memory);
}

class Emulator {
 public:
  explicit Emulator(const Options& o) : o_(o), random_(o.board.noise.seed ^ 0x5DEECE66Du) {
    if (!o.world.empty()) attach_world();
    const int count = o.board_rows * o.board_columns;
    for (int index = 0; index < count; ++index) boards.push_back(make_board(index, count));
    for (const auto& board : boards) std::printf("device %s\n", board->line().name().c_str());
    if (!o.truth.empty())
      write_file(o.truth,
                 "row,column,zero,slope,play,speed_up,speed_down,lag,delay,sensor_zero,sensor_noise,state\n" +
                     truth_);
    if (!o.table.empty()) write_file(o.table, table_text());
    std::fflush(stdout);
    if (!o.pins.empty()) boards[0]->device().keep_pins_in(map_file(o.pins, std::size_t{o.rows} * o.columns));
    boards[0]->on_period = [this] { on_first_boards_period(); };
    if (!o.patient) start_interrupts();
  }
  ~Emulator() { set_interrupts(0); }
  Emulator(const Emulator&) = delete;
  Emulator& operator=(const Emulator&) = delete;

  void run() {
    while (!stop.load() && (o_.ticks == 0 || boards[0]->periods() < o_.ticks) &&
           !(o_.once && hosts_have_left()) && !(world_ && world_->has_ended())) {
      wait();
      if (fall_silent.exchange(false)) boards[0]->fall_silent();
      if (cut.exchange(false)) boards[0]->cut_line();
      if (world_ && EmulatedBoard::now() >= world_due_) step_world();
      if (o_.storm > 0) storm();
      if (o_.patient) hold_periods();
      for (const auto& board : boards) board->step();
    }
    report();
  }

 private:
  static constexpr int kLongestHold = SSD_PATIENCE - 4;  // periods
  static constexpr double kSettled_s = 4.0;              // after the ball was placed

  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }

  void attach_world() {
    world_ = std::make_unique<hardware::World>(o_.world, stop);
    const auto& d = world_->description();
    const unsigned rows = o_.rows * o_.board_rows, columns = o_.columns * o_.board_columns;
    if (d.rows != rows || d.columns != columns)
      throw std::invalid_argument("--world: surface '" + o_.world + "' has " + std::to_string(d.columns) +
                                  "x" + std::to_string(d.rows) + " cells, but --boards and --size give " +
                                  std::to_string(columns) + "x" + std::to_string(rows));
    o_.board.period_us = world_->period_us();
  }

  // In the middle of the first board's period: the frames of all boards are in force by then, although their
  // periods do not end at the same moment, and all of them send what they sense of the same step.
  void step_world() {
    // An emulator that was not scheduled finds both due: the periods ended first.
    for (const auto& board : boards)
      if (board->period_end() <= world_due_) board->step();
    world_->step();
    world_due_ = EmulatedBoard::Time::max();
  }

  // Until all boards have their answers, but not for so long that the host takes them for gone. A board that
  // has begun its next period already gets no answer before the others begin theirs, and holds none of them.
  void hold_periods() {
    const std::chrono::microseconds period(o_.board.period_us);
    for (const auto& board : boards) board->carry();
    auto unanswered_since = EmulatedBoard::Time::max();
    for (const auto& board : boards)
      if (!board->has_answer()) unanswered_since = std::min(unanswered_since, board->period_begin());
    const auto now = EmulatedBoard::now();
    if (unanswered_since == EmulatedBoard::Time::max() || now - answered_at_ > kLongestHold * period) {
      unanswered_since = EmulatedBoard::Time::max();
      answered_at_ = now;
    }
    for (const auto& board : boards)
      board->hold_period(unanswered_since - board->period_begin() < period / 2);
  }

  std::unique_ptr<EmulatedBoard> make_board(int index, int count) {
    hardware::EmulatedBoardOptions b = o_.board;
    const std::size_t first_row = std::size_t{o_.rows} * (index / o_.board_columns),
                      first_column = std::size_t{o_.columns} * (index % o_.board_columns);
    b.noise.seed += static_cast<std::uint64_t>(index) * 0x9E3779B9u;
    if (b.tcp > 0) b.tcp += index;
    if (count > 1 && !b.link.empty()) b.link += "-" + std::to_string(index);
    if (index > 0) b.silent_at = b.unplug_at = 0;
    b.drift_ppm = o_.drift_ppm * (2 * uniform() - 1);
    b.clock_start_us = static_cast<std::uint32_t>(random_());
    const auto make =
        [&, this](const hardware::EmulatedDevice::Write& write) -> std::unique_ptr<hardware::EmulatedDevice> {
      if (world_)
        return std::make_unique<hardware::WorldDevice>(*world_, first_row, first_column, o_.rows, o_.columns,
                                                       write);
      if (o_.device == "toy") {
        std::optional<std::uint64_t> errors = o_.errors;
        if (errors) *errors = *errors * 4096 + static_cast<std::uint64_t>(index);
        auto toy =
            std::make_unique<hardware::ToyDevice>(o_.rows, o_.columns, o_.board.period_us, write, errors);
        if (errors) truth_ += toy->imperfect()->truth(o_.columns, first_row, first_column);
        return toy;
      }
      auto pillars = std::make_unique<hardware::PillarDevice>(o_.rows, o_.columns, o_.board.period_us, write);
      pillars_ = pillars_ ? pillars_ : pillars.get();
      return pillars;
    };
    auto board = std::make_unique<EmulatedBoard>(b, make);
    EmulatedBoard* const at = board.get();
    board->device().become({board_id(index), o_.limits, [at] { return at->micros(); }, {}, {}});
    return board;
  }

  static std::string board_id(int index) { return "b" + std::to_string(index); }

  std::string table_text() const {
    std::string all = "name = " + common::toml_text(o_.name) +
                      "\npitch = " + common::shortest(boards[0]->device().firmware().hello.pitch) +
                      "\nperiod_us = " + std::to_string(o_.board.period_us) + "\n";
    for (int i = 0; i < std::ssize(boards); ++i)
      all += "\n[[board]]\n" + (o_.board.version_1 ? "" : "id = " + common::toml_text(board_id(i)) + "\n") +
             "device = " + common::toml_text(boards[i]->line().name()) + "\nat = [" +
             std::to_string(i / o_.board_columns * o_.rows) + ", " +
             std::to_string(i % o_.board_columns * o_.columns) + "]\n";
    return all;
  }

  // Written at once: a program may wait for the file.
  static void write_file(const std::string& path, const std::string& text) {
    if (const std::error_code error = common::replace_file(path, text))
      throw std::runtime_error("cannot write " + path + ": " + error.message());
  }

  static void set_interrupts(std::uint32_t interval_us) {
    itimerval timer{};
    timer.it_interval.tv_sec = timer.it_value.tv_sec = interval_us / 1'000'000;
    timer.it_interval.tv_usec = timer.it_value.tv_usec = interval_us % 1'000'000;
    ::setitimer(ITIMER_REAL, &timer, nullptr);
  }

  void start_interrupts() {
    struct sigaction action {};
    action.sa_handler = interrupt;
    action.sa_flags = SA_RESTART;
    ::sigaction(SIGALRM, &action, nullptr);
    last_interrupt = EmulatedBoard::now();
    set_interrupts(std::max(o_.board.period_us / 2, 1000u));
  }

  static bool hosts_have_left() {
    return std::ranges::all_of(boards, [](const auto& board) { return board->host_has_left(); });
  }

  void wait() {
    EmulatedBoard::Time until = std::min(boards[0]->next_event(), world_due_);
    lines_.clear();
    for (const auto& board : boards) {
      until = std::min(until, board->next_event());
      lines_.push_back({board->line().descriptor(), POLLIN, 0});
    }
    const auto left = std::max(until - EmulatedBoard::now(), EmulatedBoard::Time(0));
    const timespec time{static_cast<time_t>(left.count() / 1'000'000'000),
                        static_cast<long>(left.count() % 1'000'000'000)};
    // A pseudo-terminal that no process has opened reports a hang-up immediately.
    if (::ppoll(lines_.data(), lines_.size(), &time, nullptr) > 0 &&
        std::ranges::none_of(lines_, [](const pollfd& line) { return line.revents & POLLIN; }))
      std::this_thread::sleep_for(std::min<EmulatedBoard::Time>(left, milliseconds(1)));
  }

  // Disturbs a random board, --storm times a second on average.
  void storm() {
    const auto now = EmulatedBoard::now();
    if (next_storm_ == EmulatedBoard::Time{}) next_storm_ = now;
    while (next_storm_ <= now) {
      next_storm_ +=
          EmulatedBoard::Time(static_cast<std::int64_t>(-std::log(1 - uniform()) * 1e9 / o_.storm));
      EmulatedBoard& board = *boards[random_() % boards.size()];
      const std::uint64_t periods = 5 + random_() % 95;
      const auto kind = random_() % 5;
      ++storm_counts_[static_cast<std::ptrdiff_t>(kind)];
      board.set_faults(periods, periods, kind == 1);
      if (kind <= 1) board.cut_line();
      if (kind == 2) board.fall_silent();
      if (kind == 3) board.restart();
      if (kind == 4) board.set_noise(uniform() * 2e-3, uniform() * 2e-3);
      if (kind != 4) board.set_noise(o_.board.noise.drop, o_.board.noise.corrupt);
    }
  }

  void on_first_boards_period() {
    if (world_) world_due_ = boards[0]->period_end() - std::chrono::microseconds(o_.board.period_us) / 2;
    if (o_.stop_at != 0 && boards[0]->periods() == o_.stop_at) boards[0]->device().press_stop();
    if (!pillars_ || pillars_->seconds_since_placed() <= kSettled_s) return;
    distance_sum_ += pillars_->distance();
    ++distance_count_;
  }

  void report() {
    unsigned long long dropped = 0, corrupted = 0, missed = 0, unsent = 0;
    std::vector<std::uint32_t> latency_us;
    for (const auto& board : boards) {
      dropped += board->dropped();
      corrupted += board->corrupted();
      missed += board->device().firmware().missed;
      unsent += board->device().firmware().dropped;
      latency_us.insert(latency_us.end(), board->latencies().begin(), board->latencies().end());
    }
    std::printf("periods %llu dropped %llu corrupted %llu missed %llu unsent %llu\n",
                static_cast<unsigned long long>(boards[0]->periods()), dropped, corrupted, missed, unsent);
    if (world_) std::printf("world steps %llu\n", static_cast<unsigned long long>(world_->steps()));
    if (o_.storm > 0)
      std::printf("storm unplugged %u unplugged_and_restarted %u silent %u restarted %u noisy %u\n",
                  storm_counts_[0], storm_counts_[1], storm_counts_[2], storm_counts_[3], storm_counts_[4]);
    if (!latency_us.empty()) {
      std::ranges::sort(latency_us);
      const auto quantile = [&](double share) {
        return latency_us[static_cast<std::ptrdiff_t>(share * static_cast<double>(latency_us.size() - 1))];
      };
      std::printf("answers %zu latency_us median %u p99 %u max %u\n", latency_us.size(), quantile(0.5),
                  quantile(0.99), quantile(1.0));
    }
    if (distance_count_ > 0)
      std::printf("ball distance_cm %.2f\n", distance_sum_ / static_cast<double>(distance_count_));
  }

  Options o_;
  std::mt19937_64 random_;
  std::vector<pollfd> lines_;
  std::string truth_;                                           // CSV of all boards' errors
  hardware::PillarDevice* pillars_ = nullptr;                   // the first board's, if it is one
  std::unique_ptr<hardware::World> world_;                      // null: none
  EmulatedBoard::Time world_due_ = EmulatedBoard::Time::max();  // when it steps next
  EmulatedBoard::Time next_storm_{}, answered_at_{};
  std::array<unsigned, 5> storm_counts_{};
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
      return std::fflush(stdout) == 0 ? 0 : 1;
    }
    struct sigaction action {};
    action.sa_handler = [](int number) {
      (number == SIGUSR1 ? fall_silent : number == SIGUSR2 ? cut : stop).store(true);
    };
    for (const int number : {SIGINT, SIGTERM, SIGUSR1, SIGUSR2}) sigaction(number, &action, nullptr);
    Emulator(o).run();
    return 0;
  } catch (const std::invalid_argument& e) {
    std::fprintf(stderr, "device_emulator: error: %s\n", e.what());
    return 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "device_emulator: error: %s\n", e.what());
    return 1;
  }
}
