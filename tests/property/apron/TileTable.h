// Programs as C for boards, compiled and loaded, and a table of their tiles in one process.
#pragma once

#include <dlfcn.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <regex>

#include "apron/target_c/TargetC.h"
#include "tests/property/apron/RandomProgram.h"

namespace apron::vm::test {

namespace fs = std::filesystem;

inline constexpr int kTicks = 4;
inline constexpr double kPeriod = 0.015625;

// The part of a member's name that stands for the channel: 'colour.r' is colour_r.
inline std::string member_name(std::string_view channel) {
  std::string name;
  for (const char c : channel)
    if (c != ']') name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return name;
}

// The frames that a surface gives to a program, as a function of the tick, and those that it takes. Channels
// of hits are 0 or 1.
inline Cells sensor_frame(const std::string& channel, std::uint32_t tick, std::size_t cells, unsigned seed) {
  const bool is_truth = channel == "truths" || channel.ends_with("hit");
  std::uint32_t name = 0;
  for (const char c : channel) name = name * 31 + static_cast<unsigned char>(c);
  std::mt19937 rng(seed * 1000 + tick * 2 + name);
  if (channel == "bits") {  // floats of every size
    Cells frame(cells);
    for (float& c : frame) c = std::bit_cast<float>(static_cast<std::uint32_t>(rng()));
    return frame;
  }
  if (!is_truth) return random_input(cells, seed, rng);
  Cells frame(cells);
  for (float& c : frame) c = rng() % 3 == 0 ? 1.0F : 0.0F;
  return frame;
}

class SurfaceFrames : public FakeHost {
 public:
  SurfaceFrames(std::size_t cells, unsigned seed) : cells_(cells), seed_(seed) {}
  HostStatus sense(std::string_view channel, Plane to) override {
    write_cells(to,
                sensor_frame(member_name(channel), static_cast<std::uint32_t>(step_count), cells_, seed_));
    return HostStatus::kOk;
  }
  HostStatus step() override {
    for (auto& [name, frame] : actuators)
      if (frame.size() == 1) frame.assign(cells_, frame[0]);
    auto& frame = frames.emplace_back();
    for (const auto& [name, cells] : actuators) frame[member_name(name)] = cells;
    ++step_count;
    return HostStatus::kOk;
  }
  std::optional<double> time_s() const override { return kPeriod * step_count; }
  std::optional<double> dt_s() const override { return kPeriod; }

  std::vector<std::map<std::string, Cells>> frames;

  // Like the generated code: every channel that the program names.
  bool has(std::string_view) const override { return true; }

 private:
  const std::size_t cells_;
  const unsigned seed_;
};

// ---- the generated code ----

struct Links {
  void* context;
  void (*begin)(void*, void*, std::uint32_t);
  int (*send)(void*, int, std::uint16_t, const std::uint8_t*, std::uint16_t);
  int (*receive)(void*, int, std::uint16_t, std::uint8_t*, std::uint16_t);
  void (*end)(void*, void*, std::uint32_t);
};
enum { kDone, kEdges, kEnded, kFailed };
enum { kReady, kNotYet, kGivenUp };

// A compiled tile: its functions, by name.
struct TileCode {
  std::uint32_t columns = 0, rows = 0;
  std::string name;
  unsigned (*size)() = nullptr;
  int (*init)(void*, const Links*, int, int, int, int) = nullptr;
  int (*run)(void*) = nullptr;
  const char* (*error)(const void*) = nullptr;
  float* (*channel)(void*, int) = nullptr;
  std::vector<std::string> members;
  void (*clock)(void*, double, double, double) = nullptr;
};

// The names of the members of the state that hold frames.
inline std::vector<std::string> frame_members(const std::string& header) {
  static const std::regex kMember("float ((?:sense|actuate)_\\w+)\\[");
  std::vector<std::string> members;
  for (std::sregex_iterator i(header.begin(), header.end(), kMember), end; i != end; ++i)
    members.push_back((*i)[1]);
  return members;
}

// Functions that find the members of the state, whose names depend on the program.
inline std::string access_text(const std::string& name, const std::string& header) {
  std::string text = "unsigned " + name + "_size(void) { return sizeof(" + name + "_state); }\nfloat *" +
                     name + "_channel(" + name + "_state *s, int channel) {\n  (void)channel;\n";
  const std::vector<std::string> members = frame_members(header);
  for (std::size_t i = 0; i < members.size(); ++i)
    text += "  if (channel == " + std::to_string(i) + ") return s->" + members[i] + ";\n";
  text += "  (void)s;\n  return 0;\n}\nvoid " + name + "_clock(" + name +
          "_state *s, double tick, double time, double period) {\n";
  for (const auto& [member, value] :
       {std::pair{"tick", "tick"}, {"time_s", "time"}, {"period_s", "period"}}) {
    const bool has = header.find(std::string("double ") + member + ";") != std::string::npos;
    text += (has ? "  s->" + std::string(member) + " = " : std::string("  (void)")) + value + ";\n";
  }
  return text + "  (void)s;\n}\n";
}

// Programs compiled together, because starting a compiler takes longer than compiling one.
class Library {
 public:
  Library() {
    char pattern[] = "/tmp/apron-target-c-XXXXXX";
    folder_ = mkdtemp(pattern);
  }
  ~Library() {
    if (handle_ != nullptr) dlclose(handle_);
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  void add(const target_c::Options& options, const target_c::Generated& generated) {
    std::ofstream(folder_ / (options.name + ".h")) << generated.header;
    members_[options.name] = frame_members(generated.header);
    // Every other program computes scalars as where a double has 32 bits.
    std::string define = "#define " + options.name + "_SOFT_WIDE 1\n";
    std::ranges::transform(define, define.begin(), [](unsigned char c) { return std::toupper(c); });
    define.replace(0, 7, "#define");
    std::ofstream(folder_ / (options.name + ".c"))
        << (members_.size() % 2 == 0 ? define : "") << generated.source
        << access_text(options.name, generated.header);
  }
  // True if the C compiles without a warning.
  bool build() {
    const std::string library = (folder_ / "tiles.so").string();
    const std::string command =
        std::string(APRON_C_COMPILER) +
        " -std=c99 -Wall -Wextra -Wpedantic -Wno-unused-function -Werror -O1 -fPIC -shared -o " + library +
        " " + folder_.string() + "/*.c";
    if (std::system(command.c_str()) != 0) return false;
    handle_ = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
    return handle_ != nullptr;
  }
  TileCode find(const std::string& name, std::uint32_t columns, std::uint32_t rows) const {
    TileCode code;
    code.columns = columns;
    code.rows = rows;
    code.name = name;
    code.members = members_.at(name);
    const auto bind = [&](auto& function, const char* suffix) {
      function = reinterpret_cast<std::decay_t<decltype(function)>>(dlsym(handle_, (name + suffix).c_str()));
      EXPECT_NE(function, nullptr) << name << suffix;
    };
    bind(code.size, "_size");
    bind(code.init, "_init");
    bind(code.run, "_run");
    bind(code.error, "_error");
    bind(code.channel, "_channel");
    bind(code.clock, "_clock");
    return code;
  }

 private:
  fs::path folder_;
  std::map<std::string, std::vector<std::string>> members_;
  void* handle_ = nullptr;
};

// ---- a table of tiles in one process ----

struct Message {
  std::uint32_t tick = 0;
  std::uint16_t round = 0;
  std::vector<std::uint8_t> bytes;
};

class Table;

struct Tile {
  Table* table = nullptr;
  TileCode code;
  std::uint32_t row = 0, column = 0, tick = 0;
  std::vector<double> memory;
  std::array<Tile*, 4> neighbours{};
  std::array<std::deque<Message>, 4> inbox;  // from that side
  void* state() { return memory.data(); }
};

// How a table is cut: the widths of its columns of tiles and the heights of its rows.
struct Split {
  std::vector<std::uint32_t> widths, heights;
  std::uint32_t halo = 1, unroll = 20000;
};

class Table {
 public:
  Table(Size size, const Split& split,
        const std::map<std::pair<std::uint32_t, std::uint32_t>, TileCode>& codes, unsigned seed)
      : size_(size), seed_(seed), rng_(seed) {
    std::uint32_t row = 0;
    for (const std::uint32_t height : split.heights) {
      std::uint32_t column = 0;
      for (const std::uint32_t width : split.widths) {
        auto& tile = tiles_.emplace_back(std::make_unique<Tile>());
        tile->table = this;
        tile->code = codes.at({width, height});
        tile->row = row;
        tile->column = column;
        tile->memory.resize(tile->code.size() / sizeof(double) + 1);
        column += width;
      }
      row += height;
    }
    const std::size_t across = split.widths.size();
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
      if (i % across > 0) join(i, i - 1, 0, 1);
      if (i >= across) join(i, i - across, 2, 3);
    }
    const Links links{nullptr, begin, send, receive, end};
    for (auto& tile : tiles_) {
      Links own = links;
      own.context = tile.get();
      EXPECT_EQ(
          tile->code.init(tile->state(), &own, static_cast<int>(tile->row), static_cast<int>(tile->column),
                          static_cast<int>(size.height), static_cast<int>(size.width)),
          0)
          << tile->code.name;
    }
  }

  // Runs all tiles in random turns until each has completed `ticks`, and returns the frames of each tick.
  std::vector<std::map<std::string, Cells>> run(int ticks) {
    frames_.assign(static_cast<std::size_t>(ticks), {});
    for (int idle = 0; idle < 100000; ++idle) {
      bool busy = false;
      for (auto& tile : tiles_) {
        if (tile->tick >= static_cast<std::uint32_t>(ticks) || rng_() % 4 == 0) {
          busy = busy || tile->tick < static_cast<std::uint32_t>(ticks);
          continue;
        }
        busy = true;
        const int status = tile->code.run(tile->state());
        if (status == kDone) ++tile->tick;
        if (status == kEnded) tile->tick = static_cast<std::uint32_t>(ticks);
      }
      if (!busy) return frames_;
    }
    ADD_FAILURE() << "the tiles wait for each other";
    return frames_;
  }

 private:
  void join(std::size_t a, std::size_t b, int side_of_a, int side_of_b) {
    tiles_[a]->neighbours[static_cast<std::size_t>(side_of_a)] = tiles_[b].get();
    tiles_[b]->neighbours[static_cast<std::size_t>(side_of_b)] = tiles_[a].get();
  }
  template <class Copy>
  static void with_cells(Tile& tile, Cells& frame, float* cells, const Copy& copy) {
    for (std::uint32_t r = 0; r < tile.code.rows; ++r)
      for (std::uint32_t c = 0; c < tile.code.columns; ++c)
        copy(frame[(tile.row + r) * tile.table->size_.width + tile.column + c],
             cells[r * tile.code.columns + c]);
  }
  static void begin(void* context, void* state, std::uint32_t tick) {
    Tile& tile = *static_cast<Tile*>(context);
    const Table& table = *tile.table;
    for (std::size_t i = 0; i < tile.code.members.size(); ++i) {
      if (!tile.code.members[i].starts_with("sense_")) continue;
      Cells frame = sensor_frame(tile.code.members[i].substr(6), tick,
                                 std::size_t{table.size_.width} * table.size_.height, table.seed_);
      with_cells(tile, frame, tile.code.channel(state, static_cast<int>(i)),
                 [](float& from, float& to) { to = from; });
    }
    tile.code.clock(state, tick, kPeriod * tick, kPeriod);
  }
  static void end(void* context, void* state, std::uint32_t tick) {
    Tile& tile = *static_cast<Tile*>(context);
    Table& table = *tile.table;
    if (tick >= table.frames_.size()) return;
    for (std::size_t i = 0; i < tile.code.members.size(); ++i) {
      if (!tile.code.members[i].starts_with("actuate_")) continue;
      Cells& frame = table.frames_[tick][tile.code.members[i].substr(8)];
      frame.resize(std::size_t{table.size_.width} * table.size_.height);
      with_cells(tile, frame, tile.code.channel(state, static_cast<int>(i)),
                 [](float& to, float& from) { to = from; });
    }
  }
  static int send(void* context, int side, std::uint16_t round, const std::uint8_t* bytes,
                  std::uint16_t count) {
    Tile& tile = *static_cast<Tile*>(context);
    Tile* const to = tile.neighbours[static_cast<std::size_t>(side)];
    EXPECT_NE(to, nullptr);
    if (tile.table->rng_() % 3 == 0) return kNotYet;
    to->inbox[static_cast<std::size_t>(side ^ 1)].push_back({tile.tick, round, {bytes, bytes + count}});
    return kReady;
  }
  static int receive(void* context, int side, std::uint16_t round, std::uint8_t* buffer,
                     std::uint16_t count) {
    Tile& tile = *static_cast<Tile*>(context);
    std::deque<Message>& inbox = tile.inbox[static_cast<std::size_t>(side)];
    if (inbox.empty() || tile.table->rng_() % 4 == 0) return kNotYet;
    const Message message = inbox.front();
    inbox.pop_front();
    EXPECT_EQ(message.tick, tile.tick);
    EXPECT_EQ(message.round, round);
    EXPECT_EQ(message.bytes.size(), count);
    std::copy_n(message.bytes.begin(), std::min<std::size_t>(count, message.bytes.size()), buffer);
    return kReady;
  }

  const Size size_;
  const unsigned seed_;
  std::mt19937 rng_;
  std::vector<std::unique_ptr<Tile>> tiles_;
  std::vector<std::map<std::string, Cells>> frames_;
};

}  // namespace apron::vm::test
