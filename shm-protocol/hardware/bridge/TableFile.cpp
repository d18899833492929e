#include "shm-protocol/hardware/bridge/TableFile.h"

#define TOML_EXCEPTIONS 1
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <stdexcept>
#include <string_view>

namespace hardware {
namespace {

class Reader {
 public:
  explicit Reader(std::string file) : file_(std::move(file)) {}

  [[noreturn]] void fail(std::size_t line, const std::string& what) const {
    throw std::invalid_argument(file_ + ":" + std::to_string(line) + ": " + what);
  }
  static std::size_t line_of(const toml::node& node) { return node.source().begin.line; }

  void allow(const toml::table& table, const std::string& where,
             std::initializer_list<std::string_view> keys) const {
    for (const auto& [key, value] : table) {
      if (std::ranges::find(keys, key.str()) != keys.end()) continue;
      std::string known;
      for (const std::string_view k : keys) known += (known.empty() ? "" : ", ") + std::string(k);
      fail(key.source().begin.line,
           where + "unknown key '" + std::string(key.str()) + "'; known are " + known);
    }
  }

  template <class T>
  std::optional<T> get(const toml::table& table, const std::string& where, const char* key,
                       const char* kind) const {
    const toml::node* node = table.get(key);
    if (!node) return std::nullopt;
    if (const auto value = node->value_exact<T>()) return *value;
    fail(line_of(*node), where + key + " must be " + kind);
  }

  template <class T>
  T need(const toml::table& table, const std::string& where, const char* key, const char* kind) const {
    if (const auto value = get<T>(table, where, key, kind)) return *value;
    fail(line_of(table), where + key + " is missing: " + kind);
  }

  std::optional<double> number(const toml::table& table, const std::string& where, const char* key,
                               const char* kind) const {
    const toml::node* node = table.get(key);
    if (!node) return std::nullopt;
    if (node->is_number()) return *node->value<double>();
    fail(line_of(*node), where + key + " must be " + kind);
  }

  std::optional<std::pair<std::uint32_t, std::uint32_t>> pair(const toml::table& table,
                                                              const std::string& where, const char* key,
                                                              std::int64_t least) const {
    const toml::node* node = table.get(key);
    if (!node) return std::nullopt;
    const toml::array* both = node->as_array();
    std::int64_t values[2] = {-1, -1};
    for (std::size_t i = 0; both && both->size() == 2 && i < 2; ++i)
      values[i] = (*both)[i].value_exact<std::int64_t>().value_or(-1);
    for (const std::int64_t v : values)
      if (v < least || v > 65535)
        fail(line_of(*node),
             where + key + " must be [row, column], whole numbers from " + std::to_string(least));
    return std::pair{static_cast<std::uint32_t>(values[0]), static_cast<std::uint32_t>(values[1])};
  }

 private:
  std::string file_;
};

constexpr const char* kText = "a text in quotation marks";

TableBoard read_board(const Reader& reader, const toml::table& table) {
  TableBoard board;
  board.line = Reader::line_of(table);
  board.id = reader.get<std::string>(table, "board: ", "id", kText).value_or("");
  if (board.id.size() > 16)
    reader.fail(board.line, "board '" + board.id + "': an id has at most 16 characters");
  const std::string where = board.id.empty() ? "board: " : "board '" + board.id + "': ";
  reader.allow(table, where, {"id", "device", "baud", "at", "turn", "mirror", "size", "without"});
  const auto device = reader.need<std::string>(table, where, "device", "a serial line or tcp:HOST:PORT");
  const auto baud =
      reader.get<std::int64_t>(table, where, "baud", "a speed in bits a second").value_or(115200);
  try {
    board.port =
        PortAddress::parse(device, static_cast<unsigned>(std::clamp<std::int64_t>(baud, 0, 1'000'000'000)));
  } catch (const std::invalid_argument& e) {
    reader.fail(board.line, where + e.what());
  }
  const auto at = reader.pair(table, where, "at", 0);
  if (!at)
    reader.fail(board.line, where + "at is missing: [row, column] of its north-west cell in the table");
  std::tie(board.row, board.column) = *at;
  const auto turn = reader.get<std::int64_t>(table, where, "turn", "0, 90, 180 or 270").value_or(0);
  if (turn != 0 && turn != 90 && turn != 180 && turn != 270)
    reader.fail(Reader::line_of(*table.get("turn")), where + "turn is " + std::to_string(turn) +
                                                         ", must be 0, 90, 180 or 270 (counter-clockwise)");
  board.turn = static_cast<int>(turn);
  board.mirror = reader.get<bool>(table, where, "mirror", "true or false").value_or(false);
  board.size = reader.pair(table, where, "size", 1);
  if (const toml::node* node = table.get("without")) {
    const toml::array* names = node->as_array();
    if (!names) reader.fail(Reader::line_of(*node), where + "without must be a list of channels");
    for (const toml::node& name : *names) {
      const auto text = name.value_exact<std::string>();
      if (!text) reader.fail(Reader::line_of(name), where + "without must be a list of channels");
      board.without.push_back(*text);
    }
  }
  return board;
}

}  // namespace

std::string TableSpec::place(const TableBoard& board) const {
  return file + ":" + std::to_string(board.line) + ": board '" + board.title() + "': ";
}

TableSpec read_table(const std::filesystem::path& path) {
  TableSpec spec;
  spec.file = path.string();
  const Reader reader(spec.file);
  toml::table table;
  try {
    std::error_code none;
    if (!std::filesystem::is_regular_file(path, none))
      throw std::invalid_argument(
          spec.file + ": cannot be read: " + (none ? none.message() : std::string("it is no file")));
    table = toml::parse_file(spec.file);
  } catch (const toml::parse_error& e) {
    reader.fail(e.source().begin.line, std::string(e.description()));
  }
  reader.allow(table, "", {"name", "pitch", "period_us", "holes", "board"});
  spec.name = reader.need<std::string>(table, "", "name", kText);
  spec.pitch = reader.number(table, "", "pitch", "a length above 0");
  if (spec.pitch && !(std::isfinite(*spec.pitch) && *spec.pitch > 0))
    reader.fail(Reader::line_of(*table.get("pitch")), "pitch must be a length above 0");
  const auto period =
      reader.need<std::int64_t>(table, "", "period_us", "the control period in µs, 100 to 60000000");
  if (period < 100 || period > 60'000'000)
    reader.fail(
        Reader::line_of(*table.get("period_us")),
        "period_us is " + std::to_string(period) + ", must be the control period in µs, 100 to 60000000");
  spec.period_us = static_cast<std::uint32_t>(period);
  spec.holes = reader.get<bool>(table, "", "holes", "true or false").value_or(false);
  const toml::node* const boards = table.get("board");
  if (!boards) throw std::invalid_argument(spec.file + ": has no [[board]]");
  if (!boards->is_array_of_tables()) reader.fail(Reader::line_of(*boards), "board must be [[board]] tables");
  for (const toml::node& board : *boards->as_array())
    spec.boards.push_back(read_board(reader, *board.as_table()));
  for (std::size_t i = 0; i < spec.boards.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const TableBoard &a = spec.boards[j], &b = spec.boards[i];
      if (!b.id.empty() && a.id == b.id)
        reader.fail(b.line,
                    "board '" + b.id + "': line " + std::to_string(a.line) + " has a board of the same id");
      if (a.port.text == b.port.text)
        reader.fail(b.line, "board '" + b.title() + "': device " + b.port.text + " is also that of line " +
                                std::to_string(a.line));
    }
  return spec;
}

}  // namespace hardware
