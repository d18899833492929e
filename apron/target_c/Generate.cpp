// Writes the C of a tile.
#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <numeric>

#include "apron/target_c/KernelWriter.h"
#include "apron/target_c/RuntimeText.h"
#include "apron/target_c/Schedule.h"
#include "apron/target_c/TickPaths.h"
#include "common/error/UserError.h"

namespace apron::target_c {
namespace {

using program::Opcode;

constexpr double kFrameBytes = 14.0;   // around an edge: packet header, tick, round, checksum
constexpr double kBitsPerByte = 10.0;  // of a serial line, with start and stop bit
constexpr std::size_t kMaxPositions = 65000;

constexpr const char* kCountPass = R"(  s->slot = edge_plans[plan].slot;
  if (edge_plans[plan].passes > 1) {
    uint16_t *pass = &s->passes[edge_plans[plan].counter];
    s->slot += (uint32_t)*pass * edge_plans[plan].bytes;
    if (*pass + 1 < edge_plans[plan].passes) ++*pass;
  }
)";

// The functions of mathematics.def with a prefix, as C.
std::string mathematics_text() {
  std::string text(runtime::kMathematics);
  const std::size_t begin = text.find("// ---- in floats");
  std::string body = expand(text.substr(begin == std::string::npos ? 0 : begin), "real_", {});
  for (const char* const directive : {"#define APRON_FUNCTION", "#undef APRON_FUNCTION"})
    if (const std::size_t at = body.find(directive); at != std::string::npos)
      body.erase(at, body.find('\n', at) - at);
  return "#define R float\n#define W double\n#define B int\n"
         "#define APRON_FUNCTION static inline\n#define APRON_RARE static inline\n" +
         body + "\n#undef R\n#undef W\n#undef B\n#undef APRON_FUNCTION\n#undef APRON_RARE\n";
}

class Generator {
 public:
  Generator(const program::Program& program, const Options& options, const std::string& header_file)
      : options_(options),
        header_file_(header_file),
        source_(program.files.empty() ? options.name : program.files.front()),
        tile_(trace(program, options)),
        schedule_(schedule(tile_, options.halo)),
        paths_(tile_, schedule_),
        writer_(tile_),
        is_whole_(options.tile_columns == options.columns && options.tile_rows == options.rows) {}

  Generated run() {
    check_tile();
    check_channels();
    number_scalars();
    write_regions();
    Generated generated;
    measure(generated.report);
    generated.source = source_text(generated.report);
    generated.header = header_text();
    generated.warnings = tile_.warnings;
    return generated;
  }

 private:
  void check_tile() const {
    const auto check = [&](const char* what, std::uint32_t cells, std::uint32_t table) {
      if (cells == table || cells >= options_.halo) return;
      throw common::UserError(
          fmt::format("{}: error: --halo {}: the tile has {} {}; the halo comes from the next tile alone",
                      source_, options_.halo, cells, what));
    };
    check("columns", options_.tile_columns, options_.columns);
    check("rows", options_.tile_rows, options_.rows);
  }

  // Two names may become one in C.
  void check_channels() const {
    std::map<std::string, std::string> members;
    for (const Channel& channel : tile_.channels)
      if (const auto [found, is_new] = members.try_emplace(channel_member(channel), channel.name); !is_new)
        throw common::UserError(
            fmt::format("{}: error: the channels '{}' and '{}' have the same name in C, {}", source_,
                        found->second, channel.name, found->first));
  }

  // ---- scalars ----

  void number_scalars() {
    for (std::size_t slot = 0; slot < schedule_.scalar_is_live.size(); ++slot)
      slot_.push_back(schedule_.scalar_is_live[slot] ? static_cast<int>(live_slots_++) : -1);
    for (const RegionSchedule& region : schedule_.regions)
      temporaries_ = std::max(temporaries_, region.scalars.size());
    uses_scalars_ = live_slots_ > 0 || temporaries_ > 0;
  }
  static std::string temporary(std::size_t index) { return fmt::format("s->t[{}]", index); }

  std::string scalar_text(const Region& region, NodeId id) const {
    const Node& node = region.nodes[id];
    return node.kind == NodeKind::kLiteral ? wide_text(node.literal) : scalar_names_.at(id);
  }

  std::string scalar_value(const Region& region, NodeId id) {
    const Node& node = region.nodes[id];
    const auto operand = [&](std::size_t k) { return scalar_text(region, node.operands[k]); };
    switch (node.kind) {
      case NodeKind::kScalarEntry:
        return fmt::format("s->v[{}]", slot_[node.index]);
      case NodeKind::kClock:
        return fmt::format("to_scalar(wide_of_clock(s->{}))", kClockNames[node.index]);
      case NodeKind::kScalarRandom: {
        const char* const function = node.op == Opcode::kRandomFloat   ? "random_uniform"
                                     : node.op == Opcode::kRandomGauss ? "random_normal"
                                                                       : "random_integer";
        const bool is_whole = node.op == Opcode::kRandomInt;
        scalar_random_integers_ |= is_whole;
        const std::string_view from = is_whole ? "" : "float_of_wide";
        return fmt::format("{}({}(0, 0, {}{}ULL, bits_of_float(float_of_wide({})), {}({}), {}({})))",
                           is_whole ? "to_scalar" : "wide_of_float", function,
                           node.draws_follow ? "s->draws + " : "", node.draw, operand(2), from, operand(0),
                           from, operand(1));
      }
      default:
        break;
    }
    std::vector<std::string> from;
    for (std::size_t k = 0; k < node.operands.size() && node.operands[k] != kNoNode; ++k)
      from.push_back(operand(k));
    const OperationText& operation = operation_text(node.op);
    if (!operation.is_mathematics) return expand(operation.value, "scalar_", from);
    mathematics_.insert(node.op);
    if (from.size() < 2) from.emplace_back("scalar_zero()");
    return fmt::format("wide_of_float({}(float_of_wide({}), float_of_wide({})))",
                       mathematics_function(node.op), from[0], from[1]);
  }

  // ---- regions ----

  // A statement, or the call of a kernel, which is only known once all kernels are.
  struct Line {
    std::string text;
    std::size_t call = kNoCall;
  };
  static constexpr std::size_t kNoCall = ~std::size_t{0};

  void say(const std::string& text) { lines_.push_back({"        " + text + "\n", kNoCall}); }

  void write_regions() {
    std::size_t position = 0;
    for (const RegionSchedule& region : schedule_.regions) {
      first_position_.push_back(position);
      position += 1;
      if (!is_whole_)
        position += std::ranges::count_if(
            region.steps, [](const Step& step) { return step.kind == Step::Kind::kExchange; });
    }
    if (position > kMaxPositions)
      throw common::UserError(
          fmt::format("{}: error: the program exchanges edges at more than {} places: lower --unroll",
                      source_, kMaxPositions));
    for (std::size_t i = 0; i < schedule_.regions.size(); ++i) write_region(i);
  }

  void write_region(std::size_t index) {
    const Region& region = tile_.regions[index];
    const RegionSchedule& plan = schedule_.regions[index];
    std::size_t position = first_position_[index];
    scalar_names_.clear();
    begin_case(position);
    for (std::size_t k = 0; k < plan.scalars.size(); ++k) {
      say(fmt::format("{} = {};", temporary(k), scalar_value(region, plan.scalars[k])));
      scalar_names_[plan.scalars[k]] = temporary(k);
    }
    for (const Step& step : plan.steps) {
      switch (step.kind) {
        case Step::Kind::kKernel:
          lines_.push_back({{}, writer_.add(region, plan, step, scalar_names_)});
          break;
        case Step::Kind::kImpose:
          lines_.push_back({{}, writer_.add_imposition(region, step, scalar_names_)});
          break;
        case Step::Kind::kExchange:
          if (is_whole_) break;
          say(fmt::format("start_exchange(s, {});", add_plan(index, step)));
          say(fmt::format("s->position = {};", ++position));
          say("break;");
          begin_case(position);
          break;
      }
    }
    for (const NodeId id : region.actuations)
      say(fmt::format("s->written_{} = 1;",
                      channel_member(tile_.channels[region.nodes[id].index]).substr(8)));
    for (const Move& move : plan.moves) lines_.push_back({{}, writer_.add_move(move)});
    for (const auto& [slot, id] : plan.scalars_out)
      say(fmt::format("s->v[{}] = {};", slot_[slot], scalar_text(region, id)));
    write_ending(region);
  }

  void begin_case(std::size_t position) {
    lines_.push_back({fmt::format("      case {}:\n", position), kNoCall});
  }

  void write_ending(const Region& region) {
    std::string next;
    if (region.ending == Ending::kBranch) {
      // Comparisons are conditions of elementwise.def: "as_number(...)".
      const std::string comparison = expand(operation_text(region.comparison).value, "scalar_",
                                            {scalar_text(region, region.a), scalar_text(region, region.b)});
      next = fmt::format("scalar_is_true({}) == {} ? {} : {}", comparison, region.expected ? 1 : 0,
                         first_position_[region.next[0]], first_position_[region.next[1]]);
    } else if (region.ending < Ending::kEnd) {
      next = std::to_string(first_position_[region.next[0]]);
    }
    if (tile_.uses_random)
      say(region.draws_follow ? fmt::format("s->draws += {}ULL;", region.draws)
                              : fmt::format("s->draws = {}ULL;", region.draws));
    switch (region.ending) {
      case Ending::kJump:
      case Ending::kBranch:
        say(fmt::format("s->position = (uint16_t)({});", next));
        say("break;");
        return;
      case Ending::kStep:
        say(fmt::format("end_tick(s, {});", next));
        say("return PROGRAM_DONE;");
        return;
      case Ending::kEnd:
        say("s->position = AFTER_END;");
        say("return PROGRAM_ENDED;");
        return;
      case Ending::kFail:
        say("return PROGRAM_FAILED;");  // again whenever it is called
        return;
    }
  }

  // ---- exchanges ----

  struct Plan {
    std::string strips;
    std::size_t count = 0, slot = 0, side_bytes = 0, passes = 1, counter = 0;
    bool corners = false, keeps = false;
  };

  // The cells that a tile receives from a side.
  std::size_t side_cells(const Strip& strip, std::size_t side, bool has_corners) const {
    const auto& [sides, corners] = strip.reach;
    if (side < 2) return std::size_t{sides[side]} * options_.tile_rows;
    std::size_t cells = std::size_t{sides[side]} * options_.tile_columns;
    for (std::uint32_t row = 1; has_corners && row <= sides[side]; ++row)
      for (std::size_t next = 0; next < 2; ++next) {
        const std::uint32_t corner = corners[2 * (side - 2) + next];
        cells += std::min(sides[next], corner - std::min(corner, row));
      }
    return cells;
  }

  // Bytes of the longest message of each set that travels at once.
  std::vector<std::size_t> message_bytes(const Step& step) const {
    std::array<std::size_t, 4> bytes{};
    for (const Strip& strip : step.exchange.strips) {
      const Layout& layout = step.places.at(strip.value).layout;
      for (std::size_t side = 0; side < 4; ++side) {
        const std::size_t cells = side_cells(strip, side, step.exchange.has_corners);
        bytes[side] += layout.is_truth() ? (cells + 7) / 8 : cells * storage_info(layout.storage).bytes;
      }
    }
    const std::size_t most = std::ranges::max(bytes);
    if (most > 65535)
      throw common::UserError(fmt::format(
          "{}: error: an edge has {} bytes, of at most 65535: lower --halo or --tile", source_, most));
    if (!step.exchange.has_corners) return {most};
    return {std::max(bytes[0], bytes[1]), std::max(bytes[2], bytes[3])};
  }

  // The most passes of a region in a tick; 1 if only run time shows.
  std::size_t passes(std::size_t region) const {
    std::vector<double> visits(tile_.regions.size());
    visits[region] = 1.0;
    return paths_.is_open(visits) ? 1
                                  : std::max(std::size_t{1}, static_cast<std::size_t>(paths_.most(visits)));
  }

  std::size_t add_plan(std::size_t region, const Step& step) {
    Plan plan;
    for (const Strip& strip : step.exchange.strips) {
      const Place& place = step.places.at(strip.value);
      plan.strips += fmt::format("{}{{{}, {}, {{{}}}, {{{}}}}}", plan.count++ == 0 ? "" : ", ", place.index,
                                 static_cast<int>(place.layout.storage), fmt::join(strip.reach.sides, ", "),
                                 fmt::join(strip.reach.corners, ", "));
    }
    plan.corners = step.exchange.has_corners;
    plan.side_bytes = std::ranges::max(message_bytes(step));
    // Start regions run once, so they need no slot.
    plan.keeps = !tile_.regions[region].is_start;
    if (plan.keeps) {
      plan.passes = passes(region);
      if (plan.passes > 1) plan.counter = counted_plans_++;
      plan.slot = slot_bytes_;
      slot_bytes_ += plan.passes * plan.side_bytes;
    }
    max_edge_ = std::max(max_edge_, plan.side_bytes);
    plans_.push_back(plan);
    return plans_.size() - 1;
  }

  std::string plans_text() const {
    std::string text;
    for (std::size_t i = 0; i < plans_.size(); ++i)
      text += fmt::format("static const edge_strip strips_{}[] = {{{}}};\n", i, plans_[i].strips);
    text += "static const edge_plan edge_plans[] = {\n";
    for (std::size_t i = 0; i < plans_.size(); ++i)
      text += fmt::format("    {{strips_{}, {}, {}, {}, {}{}}},\n", i, plans_[i].count,
                          plans_[i].corners ? 1 : 0, plans_[i].keeps ? 1 : 0, plans_[i].slot,
                          counted_plans_ == 0 ? ""
                                              : fmt::format(", {}, {}, {}", plans_[i].side_bytes,
                                                            plans_[i].passes, plans_[i].counter));
    return text + "};\n";
  }

  // ---- cost ----

  void measure(Report& report) {
    const std::size_t count = tile_.regions.size();
    std::vector<double> rounds(count), waits(count), bytes(count);
    for (std::size_t i = 0; i < count && !is_whole_; ++i)
      for (const Step& step : schedule_.regions[i].steps) {
        if (step.kind != Step::Kind::kExchange) continue;
        const std::vector<std::size_t> messages = message_bytes(step);
        rounds[i] += 1.0;
        waits[i] += static_cast<double>(messages.size());
        for (const std::size_t message : messages) bytes[i] += static_cast<double>(message);
      }
    report.rounds = static_cast<std::size_t>(paths_.most(rounds));
    report.waits = static_cast<std::size_t>(paths_.most(waits));
    report.edge_bytes = static_cast<std::size_t>(paths_.most(bytes));
    report.has_open_loops = paths_.is_open(rounds);
    std::vector<double> seconds(count);
    for (std::size_t i = 0; i < count && options_.link_baud > 0.0; ++i)
      seconds[i] = (bytes[i] + kFrameBytes * waits[i]) * kBitsPerByte / options_.link_baud +
                   waits[i] * options_.turnaround_s;
    check_link(report, paths_.most(seconds));
    report.plane_bytes = 0;
    for (const auto& [layout, planes] : schedule_.planes)
      report.plane_bytes += planes * plane_cells(layout) * storage_info(layout.storage).bytes;
    report.strip_bytes =
        plans_.empty() ? 0 : 4 * std::max(slot_bytes_, max_edge_) + max_edge_ + 2 * counted_plans_;
    report.scalar_bytes = 8 * (live_slots_ + temporaries_) + (tile_.uses_random ? 8 : 0);
    report.channel_bytes = tile_.channels.size() * 4 * options_.tile_columns * options_.tile_rows;
    report.regions = count;
    report.kernels = writer_.function_count();
    report.needs_double = !all_mathematics().empty();
  }

  void check_link(const Report& report, double seconds) const {
    if (options_.link_baud <= 0.0) return;
    if (report.has_open_loops)
      throw common::UserError(
          fmt::format("{}: error: --link: a loop of the program exchanges edges as often as only run time "
                      "tells, so that a tick has no bound",
                      source_));
    if (seconds * options_.rate_hz <= 1.0) return;
    throw common::UserError(fmt::format(
        "{}: error: the edges of a tick take {:.3g} ms over a link of {:g} baud ({} rounds, {} waits of {:g} "
        "us and {} bytes in sequence, at most), and a tick at {:g} Hz has {:.3g} ms: a faster --link, "
        "another --halo or a lower --rate",
        source_, 1e3 * seconds, options_.link_baud, report.rounds, report.waits, 1e6 * options_.turnaround_s,
        report.edge_bytes, options_.rate_hz, 1e3 / options_.rate_hz));
  }

  // ---- text ----

  std::size_t plane_cells(const Layout& layout) const {
    const std::size_t margin = layout.has_margin ? 2 * margin_width() : 0;
    return (options_.tile_columns + margin) * (options_.tile_rows + margin);
  }
  std::size_t margin_width() const { return std::max<std::size_t>(options_.halo, 1); }

  std::set<Opcode> all_mathematics() const {
    std::set<Opcode> all = mathematics_;
    all.insert(writer_.mathematics().begin(), writer_.mathematics().end());
    return all;
  }
  bool uses_random_integers() const { return scalar_random_integers_ || writer_.uses_random_integers(); }
  bool uses_wide() const { return uses_scalars_ || uses_random_integers() || !all_mathematics().empty(); }
  template <class Condition>
  bool has_nodes(const Condition& condition) const {
    return std::ranges::any_of(
        tile_.regions, [&](const Region& region) { return std::ranges::any_of(region.nodes, condition); });
  }
  bool has_exchanges() const { return !plans_.empty(); }

  std::string state_members() const {
    std::string text;
    for (const auto& [layout, count] : schedule_.planes)
      text += fmt::format("  {} {}[{}][{}];\n", storage_info(layout.storage).c_type, plane_array(layout),
                          count, plane_cells(layout));
    if (live_slots_ > 0) text += fmt::format("  program_wide_number v[{}];\n", live_slots_);
    if (temporaries_ > 0) text += fmt::format("  program_wide_number t[{}];\n", temporaries_);
    if (tile_.uses_random) text += "  uint64_t draws;\n";
    if (has_exchanges())
      text += fmt::format("  uint8_t edges[4][{}], message[{}];\n",
                          std::max({slot_bytes_, max_edge_, std::size_t{1}}),
                          std::max<std::size_t>(max_edge_, 1));
    if (counted_plans_ > 0) text += fmt::format("  uint32_t slot;\n  uint16_t passes[{}];\n", counted_plans_);
    return text;
  }
  static std::string plane_array(const Layout& layout) {
    return std::string(layout.has_margin ? "" : "own_") + storage_info(layout.storage).name;
  }

  // Without what would end a comment.
  static std::string comment_text(std::string text) {
    replace_all(text, "*/", "* /");
    return text;
  }

  std::string channel_members() const {
    std::string text;
    const std::string cells = renamed("PROGRAM_ROWS * PROGRAM_COLUMNS");
    for (const Channel& channel : tile_.channels) {
      text += fmt::format("  float {}[{}]; /* {} */\n", channel_member(channel), cells,
                          comment_text(channel.name));
      if (!channel.is_sensor)
        text += fmt::format("  uint8_t written_{};\n", channel_member(channel).substr(8));
    }
    for (std::size_t k = 0; k < 3; ++k)
      if (tile_.uses_clock[k]) text += fmt::format("  double {}; /* written by begin() */\n", kClockNames[k]);
    return text;
  }

  // Identifiers that begin with program_ or PROGRAM_ begin with the name instead. Whatever the name is, no
  // other identifier becomes one of them: none ends with an underscore and the rest of one.
  std::string renamed(std::string text) const {
    std::string upper = options_.name;
    std::ranges::transform(upper, upper.begin(),
                           [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    constexpr std::size_t kLength = std::string_view("program").size();
    for (std::size_t at = text.find('_'); at != std::string::npos; at = text.find('_', at + 1)) {
      const std::size_t begin = at - std::min(at, kLength);
      const std::string word = text.substr(begin, at - begin);
      if ((word != "program" && word != "PROGRAM") || (begin > 0 && is_word(text[begin - 1]))) continue;
      text.replace(begin, kLength, word == "program" ? options_.name : upper);
      at = begin + options_.name.size();
    }
    return text;
  }

  // `text` with what stands for each @NAME@.
  static std::string filled(std::string_view text, const std::map<std::string_view, std::string>& values) {
    std::string result;
    for (;;) {
      const std::size_t begin = text.find('@');
      result += text.substr(0, begin);
      if (begin == std::string_view::npos) return result;
      const std::size_t end = text.find('@', begin + 1);
      result += values.at(text.substr(begin + 1, end - begin - 1));
      text.remove_prefix(end + 1);
    }
  }

  std::string header_text() const {
    return filled(renamed(std::string(runtime::kHeader)),
                  {{"SOURCE", comment_text(source_)},
                   {"TILE_COLUMNS", std::to_string(options_.tile_columns)},
                   {"TILE_ROWS", std::to_string(options_.tile_rows)},
                   {"COLUMNS", std::to_string(options_.columns)},
                   {"ROWS", std::to_string(options_.rows)},
                   {"BUFFER", std::to_string(std::max<std::size_t>(max_edge_, 1))},
                   {"CHANNELS", channel_members()},
                   {"STATE", renamed(state_members())}});
  }

  std::string body_text() const {
    std::string text;
    for (const Line& line : lines_)
      text += line.call == kNoCall ? line.text : "        " + writer_.call(line.call) + "\n";
    return text;
  }

  std::string error_text() const {
    std::string text;
    for (std::size_t i = 0; i < tile_.regions.size(); ++i)
      if (const Region& region = tile_.regions[i]; region.ending == Ending::kFail)
        text += fmt::format("    case {}:\n      return {};\n", first_position_[i], quoted(region.error));
    return text;
  }

  // As a string of C.
  static std::string quoted(const std::string& text) {
    std::string literal = "\"";
    for (const char c : text) {
      const auto byte = static_cast<unsigned char>(c);
      if (byte >= 0x20 && byte < 0x7F && c != '"' && c != '\\' && c != '?')
        literal += c;
      else
        literal += fmt::format("\\{:03o}", byte);
    }
    return literal + '"';
  }

  std::string start_text() const {
    std::string text;
    for (std::size_t slot = 0; slot < slot_.size(); ++slot)
      if (slot_[slot] >= 0)
        text += fmt::format("  s->v[{}] = {};\n", slot_[slot],
                            wide_text(static_cast<double>(tile_.scalar_start[slot])));
    return text;
  }

  std::string source_text(const Report&) {
    std::string text(runtime::kSource);
    text += fmt::format(
        "enum {{ COLUMNS_OF_TABLE = {}, ROWS_OF_TABLE = {}, MARGIN = {}, "
        "PITCH = PROGRAM_COLUMNS + 2 * MARGIN, AFTER_END = 65535, ALL_SIDES = 15, ROW_ENDS = 3 }};\n",
        options_.columns, options_.rows, margin_width());
    for (const auto& [layout, count] : schedule_.planes)
      text += fmt::format("#define {}(i) (s->{}[i]{})\n", plane_macro(layout), plane_array(layout),
                          layout.has_margin ? " + MARGIN * PITCH + MARGIN" : "");
    text += "\n";
    text += runtime::kArithmetic;
    if (has_nodes([](const Node& node) { return program::is_integer(node.type); }))
      text += runtime::kIntegers;
    const std::set<Opcode> mathematics = all_mathematics();
    if (uses_wide()) text += runtime::kWide;
    if (uses_wide() && has_nodes([](const Node& node) {
          return program::is_integer(node.type) || program::takes_only_integers(node.op);
        }))
      text += runtime::kWhole;
    if (!mathematics.empty()) {
      text += runtime::kDouble;
      text += runtime::kAngle;
      text += mathematics_text();
      for (const Opcode op : mathematics)
        text += fmt::format("static float {}(float a, float b) {{\n  (void)b;\n  return {};\n}}\n",
                            mathematics_function(op), expand(operation_text(op).value, "real_", {}));
    }
    if (tile_.uses_random) text += runtime::kRandom;
    if (uses_random_integers()) text += runtime::kRandomInteger;
    std::string exchange(runtime::kExchange);
    const std::size_t edge = exchange.find("/* ---- the table's edge");
    std::string loads, stores, impositions;
    const std::string impose = exchange.substr(edge);
    exchange.resize(edge);
    // A program without planes of one storage has no array of it.
    for (const Storage storage : kStorages) {
      const Layout layout{storage, true};
      if (schedule_.planes.count(layout) == 0) continue;
      const bool is_float = storage == Storage::kFloat;
      const auto [name, c_type, bytes] = storage_info(storage);
      const std::string cell = plane_macro(layout) + "(strip->plane)[at]";
      loads += fmt::format("    case {}: return {}({});\n", static_cast<int>(storage),
                           is_float ? "bits_of_float" : "(uint32_t)", cell);
      stores += fmt::format("    case {}: {} = {}(bits); break;\n", static_cast<int>(storage), cell,
                            is_float ? "float_of_bits" : fmt::format("({})", c_type));
      impositions += fmt::format("IMPOSE(impose_{}, {})\n", name, c_type);
    }
    if (has_exchanges()) {
      replace_all(exchange, "@PLANS@\n", plans_text());
      const bool counts = counted_plans_ > 0;
      replace_all(exchange, "@PASS_MEMBERS@\n",
                  counts ? "  uint16_t bytes, passes, counter; /* each pass of a tick has its own */\n" : "");
      replace_all(exchange, "@SLOT@", counts ? "s->slot" : "plan->slot");
      replace_all(exchange, "@COUNT@\n", counts ? kCountPass : "");
      replace_all(exchange, "@LOADS@\n", loads);
      replace_all(exchange, "@STORES@\n", stores);
      text += exchange;
    }
    if (!impositions.empty()) text += impose + impositions;
    text += "\n/* ---- kernels ---- */\n\n" + writer_.functions();
    std::string run(runtime::kRun);
    if (!has_exchanges())
      replace_all(run, "    if (s->phase != 0 && !exchange(s)) return PROGRAM_EDGES;\n", "");
    std::string first_pass;
    if (counted_plans_ > 0)
      first_pass = fmt::format("    for (int i = 0; i < {}; ++i) s->passes[i] = 0;\n", counted_plans_);
    replace_all(run, "@FIRST_PASS@\n", first_pass);
    replace_all(run, "@START@\n", start_text());
    replace_all(run, "@BODY@\n", body_text());
    text += run;
    return filled(renamed(std::move(text)),
                  {{"SOURCE", comment_text(source_)}, {"HEADER", header_file_}, {"ERRORS", error_text()}});
  }

  static constexpr std::array<const char*, 3> kClockNames{"tick", "time_s", "period_s"};

  const Options& options_;
  const std::string header_file_, source_;
  TileProgram tile_;
  Schedule schedule_;
  const TickPaths paths_;
  KernelWriter writer_;
  const bool is_whole_;  // one tile: nothing is exchanged
  std::vector<int> slot_;
  std::size_t live_slots_ = 0, temporaries_ = 0;
  bool uses_scalars_ = false, scalar_random_integers_ = false;
  std::set<Opcode> mathematics_;
  std::map<NodeId, std::string> scalar_names_;
  std::vector<std::size_t> first_position_;
  std::vector<Line> lines_;
  std::vector<Plan> plans_;
  std::size_t slot_bytes_ = 0, max_edge_ = 0, counted_plans_ = 0;
};

}  // namespace

Generated generate(const program::Program& program, const Options& options, const std::string& header_file) {
  return Generator(program, options, header_file).run();
}

}  // namespace apron::target_c
