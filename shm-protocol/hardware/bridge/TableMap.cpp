#include "shm-protocol/hardware/bridge/TableMap.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "common/text/Number.h"

namespace hardware {
namespace {

constexpr std::uint64_t kMaxCells = std::uint64_t{1} << 24;

struct Place {
  std::uint32_t row, column;
};

// Where a cell of a board of rows × columns comes to lie in the mounted board.
Place mounted(const TableBoard& board, std::uint32_t rows, std::uint32_t columns, std::uint32_t row,
              std::uint32_t column) {
  if (board.mirror) column = columns - 1 - column;
  switch (board.turn) {
    case 90:  // east becomes north, south becomes east
      return {columns - 1 - column, row};
    case 180:
      return {rows - 1 - row, columns - 1 - column};
    case 270:  // east becomes south, south becomes west
      return {column, rows - 1 - row};
    default:
      return {row, column};
  }
}

const char* direction(bool sensor) { return sensor ? "sensor" : "actuator"; }
std::string title_of(const DeviceChannel& c) {
  return std::string(direction(c.sensor)) + " '" + c.name + "'";
}

std::string shown(const std::string& text) { return "'" + text + "'"; }
std::string shown(std::uint32_t number) { return std::to_string(number); }
std::string shown(float number) { return common::shortest(number); }
std::string shown(const std::array<float, 3>& at) {
  return "(" + shown(at[0]) + ", " + shown(at[1]) + ", " + shown(at[2]) + ")";
}
std::string type_name(std::uint8_t dtype) {
  return dtype == SSW_F32 ? "f32" : dtype == SSW_U16 ? "u16" : "u8";
}

// Says which field differs first, before and after; nothing: none does.
class Change {
 public:
  template <class T>
  void compare(const std::string& field, const T& before, const T& after) {
    if (text_.empty() && before != after) set(field, shown(before), shown(after));
  }
  void set(const std::string& field, const std::string& before, const std::string& after) {
    if (text_.empty()) text_ = field + " from " + before + " to " + after;
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

void compare_channels(const DeviceChannel& before, const DeviceChannel& after, Change& change) {
  const std::string title = title_of(before);
  change.compare("unit of " + title, before.unit, after.unit);
  if (before.dtype != after.dtype)
    change.set("type of " + title, type_name(before.dtype), type_name(after.dtype));
  change.compare("components of " + title, before.components, after.components);
  change.compare("minimum of " + title, before.minimum, after.minimum);
  change.compare("maximum of " + title, before.maximum, after.maximum);
  change.compare("safe value of " + title, before.safe, after.safe);
  change.compare("scale of " + title, before.scale, after.scale);
  change.compare("offset of " + title, before.offset, after.offset);
  change.compare("flags of " + title, std::uint32_t{before.flags}, std::uint32_t{after.flags});
}

void compare_cells(const DeviceDescription& before, const DeviceDescription& after, Change& change) {
  const std::size_t cells = std::size_t{before.rows} * before.columns;
  if (before.mask != after.mask) {
    for (std::size_t i = 0; i < cells; ++i)
      change.compare("mask of cell " + std::to_string(i), before.mask.empty() || before.mask[i] ? 1U : 0U,
                     after.mask.empty() || after.mask[i] ? 1U : 0U);
  }
  if (before.positions.empty() != after.positions.empty())
    change.set("layout", before.positions.empty() ? "a grid" : "own positions",
               after.positions.empty() ? "a grid" : "own positions");
  else if (before.positions != after.positions)
    for (std::size_t i = 0; i < before.positions.size(); ++i)
      change.compare("position of cell " + std::to_string(i), before.positions[i], after.positions[i]);
}

// The difference that makes it another board, "" if none; limits and program may change.
std::string change_between(const DeviceDescription& before, const DeviceDescription& after) {
  Change change;
  change.compare("id", before.id, after.id);
  change.compare("rows", before.rows, after.rows);
  change.compare("columns", before.columns, after.columns);
  if (!change.text().empty()) return change.text();  // the rest goes by cells
  compare_cells(before, after, change);
  const auto find = [](const DeviceDescription& d, const DeviceChannel& like) {
    return std::ranges::find_if(
        d.channels, [&](const DeviceChannel& c) { return c.sensor == like.sensor && c.name == like.name; });
  };
  for (const DeviceChannel& c : before.channels)
    if (const auto now = find(after, c); now != after.channels.end())
      compare_channels(c, *now, change);
    else
      change.set(title_of(c), "present", "absent");
  for (const DeviceChannel& c : after.channels)
    if (find(before, c) == before.channels.end()) change.set(title_of(c), "absent", "present");
  return change.text();
}

}  // namespace

VectorTurn vector_turn(int turn, bool mirror, bool axial) {
  // A mirror reverses east; of an axial vector, it reverses what is not east.
  const int mx = mirror && !axial ? -1 : 1, my = mirror && axial ? -1 : 1;
  const int c = turn == 0 ? 1 : turn == 180 ? -1 : 0, s = turn == 90 ? 1 : turn == 270 ? -1 : 0;
  return {c * mx, -s * my, s * mx, c * my, mirror && axial ? -1 : 1};
}

VectorTurn inverse(const VectorTurn& t) { return {t.xx, t.yx, t.xy, t.yy, t.z}; }

TableMap::TableMap(const TableSpec& spec) : spec_(spec), boards_(spec.boards.size()) {
  pitch_ = spec.pitch.value_or(0);
}

void TableMap::fail(std::size_t index, const std::string& what) const {
  throw std::invalid_argument(spec_.place(spec_.boards[index]) + what);
}

MountedBoard TableMap::place(std::size_t index, std::uint32_t rows, std::uint32_t columns) const {
  const TableBoard& spec = spec_.boards[index];
  MountedBoard board;
  board.row = spec.row;
  board.column = spec.column;
  const bool upright = spec.turn % 180 == 0;
  board.rows = upright ? rows : columns;
  board.columns = upright ? columns : rows;
  if (std::uint64_t{board.row} + board.rows > 65536 || std::uint64_t{board.column} + board.columns > 65536)
    fail(index, "it ends beyond row or column 65535");
  return board;
}

void TableMap::require_free(std::size_t index, const MountedBoard& board) const {
  for (std::size_t other = 0; other < boards_.size(); ++other) {
    const MountedBoard& o = boards_[other];
    if (other == index || o.rows == 0) continue;
    const std::uint32_t row = std::max(o.row, board.row), column = std::max(o.column, board.column);
    if (row < std::min(o.row + o.rows, board.row + board.rows) &&
        column < std::min(o.column + o.columns, board.column + board.columns))
      fail(index, "overlaps board '" + spec_.boards[other].title() + "' of line " +
                      std::to_string(spec_.boards[other].line) + " at row " + std::to_string(row) +
                      ", column " + std::to_string(column));
  }
}

void TableMap::require_same(std::size_t index, const DeviceDescription& d) const {
  if (!boards_[index].device) return;
  if (const std::string change = change_between(*boards_[index].device, d); !change.empty())
    fail(index, "it has changed since it first came: " + change);
}

// Before anything is kept for each of its cells.
void TableMap::enclose(const MountedBoard& board) {
  rows_ = std::max(rows_, board.row + board.rows);
  columns_ = std::max(columns_, board.column + board.columns);
  if (std::uint64_t{rows_} * columns_ > kMaxCells)
    throw std::invalid_argument(spec_.file + ": a table of " + std::to_string(rows_) + " rows of " +
                                std::to_string(columns_) + " cells is too large");
}

void TableMap::mount(std::size_t index, const DeviceDescription& d) {
  const TableBoard& spec = spec_.boards[index];
  if (frozen_) require_same(index, d);
  if (!spec.id.empty() && d.id != spec.id)
    fail(index, d.version < 2
                    ? "the device speaks version 1 of the byte protocol, which has no id: leave id out"
                    : "the device is board '" + d.id + "'");
  if (spec.size && *spec.size != std::pair{d.rows, d.columns})
    fail(index, "the device has " + std::to_string(d.rows) + " rows of " + std::to_string(d.columns) +
                    " cells, not size = [" + std::to_string(spec.size->first) + ", " +
                    std::to_string(spec.size->second) + "]");
  if (d.period_us != spec_.period_us)
    fail(index, "the device's control period is " + std::to_string(d.period_us) + " µs, period_us is " +
                    std::to_string(spec_.period_us));
  if (pitch_ == 0) pitch_ = static_cast<double>(d.pitch);
  if (std::abs(static_cast<double>(d.pitch) - pitch_) > 1e-6 * pitch_)
    fail(index, "the device's pitch is " + shown(d.pitch) + ", the table's " + common::shortest(pitch_));
  MountedBoard board = place(index, d.rows, d.columns);
  if (frozen_ && (board.row + board.rows > rows_ || board.column + board.columns > columns_))
    fail(index, "it is larger than the table");
  require_free(index, board);
  if (!frozen_) enclose(board);
  for (const std::string& name : spec.without)
    if (std::ranges::find(d.channels, name, &DeviceChannel::name) == d.channels.end())
      fail(index, "without names '" + name + "', a channel that the device does not have");
  std::vector<TableChannel> channels = channels_;
  for (std::size_t i = 0; i < d.channels.size(); ++i) {
    const DeviceChannel& c = d.channels[i];
    if (std::ranges::find(spec.without, c.name) != spec.without.end()) continue;
    if (c.sensor && (c.name == "valid" || c.name == "age"))
      fail(index, "its sensor '" + c.name + "' has the name of one of the table's own");
    auto known = std::ranges::find_if(
        channels, [&](const TableChannel& t) { return t.sensor == c.sensor && t.name == c.name; });
    const std::string title = title_of(c);
    const bool plain_u8 = c.is_plain_u8() && std::ranges::find(spec_.calibrated_channels, c.name) ==
                                                 spec_.calibrated_channels.end();
    if (known == channels.end()) {
      if (frozen_) fail(index, "the " + title + " was not there when the session began");
      channels.push_back({c.name, c.unit, c.sensor, plain_u8, c.components, c.minimum, c.maximum, c.safe});
      known = channels.end() - 1;
    }
    if (known->unit != c.unit || known->components != c.components)
      fail(index, "the " + title + " has unit '" + c.unit + "' and " + std::to_string(c.components) +
                      " components; that of other boards has '" + known->unit + "' and " +
                      std::to_string(known->components));
    if (frozen_ &&
        (c.minimum < known->minimum || c.maximum > known->maximum || (known->plain_u8 && !plain_u8)))
      fail(index, "the " + title + " has another range or type than when the session began");
    known->plain_u8 = known->plain_u8 && plain_u8;
    known->minimum = std::min(known->minimum, c.minimum);
    known->maximum = std::max(known->maximum, c.maximum);
    const bool vector = (c.flags & (SSW_VECTOR | SSW_AXIAL_VECTOR)) != 0;
    if (vector && c.components < 2) fail(index, "the " + title + " is a vector of one component");
    board.channels.push_back({static_cast<std::size_t>(known - channels.begin()), i, vector,
                              vector_turn(spec.turn, spec.mirror, (c.flags & SSW_AXIAL_VECTOR) != 0)});
  }
  channels_ = std::move(channels);
  const std::size_t cells = std::size_t{d.rows} * d.columns;
  board.exists = d.mask.empty() ? std::vector<std::uint8_t>(cells, 1) : d.mask;
  board.positions = d.positions;
  board.device = d;
  board.cells.resize(cells);
  boards_[index] = std::move(board);
  if (frozen_) {
    for (std::size_t cell = 0; cell < cells; ++cell) {
      const Place at = mounted(spec, d.rows, d.columns, static_cast<std::uint32_t>(cell / d.columns),
                               static_cast<std::uint32_t>(cell % d.columns));
      boards_[index].cells[cell] = (spec.row + at.row) * columns_ + spec.column + at.column;
    }
  }
}

// The last board of the file in the column of a hole, or else in its row, or else the last one.
std::size_t TableMap::board_beside(std::uint32_t row, std::uint32_t column) const {
  const auto last = [this](const auto& is_beside) {
    const auto found = std::find_if(boards_.rbegin(), boards_.rend(), is_beside);
    return found == boards_.rend() ? std::nullopt : std::optional<std::size_t>(boards_.rend() - found - 1);
  };
  const auto in_column =
      last([&](const MountedBoard& b) { return column >= b.column && column < b.column + b.columns; });
  if (in_column) return *in_column;
  return last([&](const MountedBoard& b) { return row >= b.row && row < b.row + b.rows; })
      .value_or(boards_.size() - 1);
}

void TableMap::freeze() {
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    if (boards_[i].rows != 0) continue;
    const auto& size = spec_.boards[i].size;
    if (!size) fail(i, "is not there, and has no size = [rows, columns]");
    MountedBoard board = place(i, size->first, size->second);
    require_free(i, board);
    enclose(board);
    board.cells.resize(std::size_t{size->first} * size->second);
    board.exists.assign(board.cells.size(), 1);
    boards_[i] = std::move(board);
  }
  std::vector<std::uint8_t> covered(std::size_t{rows_} * columns_, 0);
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    const TableBoard& spec = spec_.boards[i];
    MountedBoard& board = boards_[i];
    const std::uint32_t rows = spec.turn % 180 == 0 ? board.rows : board.columns;
    const std::uint32_t columns = spec.turn % 180 == 0 ? board.columns : board.rows;
    for (std::uint32_t cell = 0; cell < board.cells.size(); ++cell) {
      const Place at = mounted(spec, rows, columns, cell / columns, cell % columns);
      board.cells[cell] = (spec.row + at.row) * columns_ + spec.column + at.column;
      covered[board.cells[cell]] = 1;
    }
  }
  const auto hole = std::ranges::find(covered, 0);
  if (hole != covered.end() && !spec_.holes) {
    const auto cell = static_cast<std::uint32_t>(hole - covered.begin());
    const std::uint32_t row = cell / columns_, column = cell % columns_;
    fail(board_beside(row, column), "no board covers row " + std::to_string(row) + ", column " +
                                        std::to_string(column) +
                                        "; if the table has holes, add holes = true");
  }
  frozen_ = true;
}

std::vector<std::array<float, 3>> TableMap::positions() const {
  if (std::ranges::all_of(boards_, [](const MountedBoard& b) { return b.positions.empty(); })) return {};
  std::vector<std::array<float, 3>> all(std::size_t{rows_} * columns_);
  const auto grid = [&](std::uint32_t row, std::uint32_t column) {
    return std::array<float, 3>{static_cast<float>(column * pitch_),
                                static_cast<float>((rows_ - 1 - row) * pitch_), 0.0F};
  };
  for (std::uint32_t cell = 0; cell < all.size(); ++cell) all[cell] = grid(cell / columns_, cell % columns_);
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    const MountedBoard& board = boards_[i];
    if (board.positions.empty()) continue;
    const std::uint32_t corner = board.cells[0];  // the board's own north-west cell
    const std::array<float, 3> origin = grid(corner / columns_, corner % columns_);
    const VectorTurn t = vector_turn(spec_.boards[i].turn, spec_.boards[i].mirror, false);
    for (std::size_t cell = 0; cell < board.cells.size(); ++cell) {
      const auto& [x, y, z] = board.positions[cell];
      all[board.cells[cell]] = {origin[0] + static_cast<float>(t.xx) * x + static_cast<float>(t.xy) * y,
                                origin[1] + static_cast<float>(t.yx) * x + static_cast<float>(t.yy) * y, z};
    }
  }
  return all;
}

namespace {

// Component k of a vector: of x and y, or z.
float turned(const VectorTurn& t, std::uint32_t k, float x, float y, float z) {
  if (k == 0) return static_cast<float>(t.xx) * x + static_cast<float>(t.xy) * y;
  if (k == 1) return static_cast<float>(t.yx) * x + static_cast<float>(t.yy) * y;
  return static_cast<float>(t.z) * z;
}

}  // namespace

void copy_to_table(const MountedBoard& board, const BoardChannel& channel, std::uint32_t components,
                   const float* from, float* to, std::size_t table_cells) {
  const std::size_t cells = board.cells.size();
  for (std::uint32_t k = 0; k < components; ++k) {
    const float* plane = from + k * cells;
    float* const out = to + k * table_cells;
    const bool turns = channel.vector && k < 3;
    for (std::size_t i = 0; i < cells; ++i)
      if (board.exists[i])
        out[board.cells[i]] = turns ? turned(channel.turn, k, from[i], from[cells + i], plane[i]) : plane[i];
  }
}

void copy_to_board(const MountedBoard& board, const BoardChannel& channel, std::uint32_t components,
                   const float* from, std::size_t table_cells, float* to) {
  const std::size_t cells = board.cells.size();
  const VectorTurn back = inverse(channel.turn);
  for (std::uint32_t k = 0; k < components; ++k) {
    const float* plane = from + k * table_cells;
    const bool turns = channel.vector && k < 3;
    for (std::size_t i = 0; i < cells; ++i) {
      const std::size_t at = board.cells[i];
      if (!board.exists[i]) continue;
      to[k * cells + i] = turns ? turned(back, k, from[at], from[table_cells + at], plane[at]) : plane[at];
    }
  }
}

}  // namespace hardware
