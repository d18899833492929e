// Where the cells of mounted boards are in their table. Plain functions without I/O.
//
// A board is mirrored first (west and east swapped), then turned counter-clockwise as seen from above.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "shm-protocol/hardware/bridge/DeviceLink.h"
#include "shm-protocol/hardware/bridge/TableFile.h"

namespace hardware {

// Components 0 and 1 of a vector in the table's axes, from those in the board's: east and north.
struct VectorTurn {
  int xx = 1, xy = 0, yx = 0, yy = 1;  // x' = xx·x + xy·y, y' = yx·x + yy·y
  int z = 1;
};
VectorTurn vector_turn(int turn, bool mirror, bool axial);
VectorTurn inverse(const VectorTurn&);

// A channel of the table: what the boards' channels of one direction and name have in common.
struct TableChannel {
  std::string name, unit;
  bool sensor = true, plain_u8 = true;
  std::uint32_t components = 1;
  float minimum = 0, maximum = 1, safe = 0;
};

// A channel of a board, and its place in the table.
struct BoardChannel {
  std::size_t table_channel = 0, device_channel = 0;
  bool vector = false;
  VectorTurn turn;  // from the board to the table
};

// A board in the table.
struct MountedBoard {
  std::uint32_t row = 0, column = 0, rows = 0, columns = 0;  // what it covers
  std::vector<std::uint32_t> cells;                          // of the table, by the board's cells
  std::vector<std::uint8_t> exists;                          // by the board's cells
  std::vector<std::array<float, 3>> positions;  // by the board's cells, in the table; empty: a grid
  std::vector<BoardChannel> channels;
  std::optional<DeviceDescription> device;  // as mounted; nothing: it has not come yet
};

class TableMap {
 public:
  explicit TableMap(const TableSpec&);

  // Places the board `index` as its device describes it. Throws std::invalid_argument with one line: the
  // board is not as the file says, overlaps another, or its channels do not match those of the others. After
  // freeze(), channels of the table no longer change, and a board that has come must stay the same: its id,
  // rows, columns, mask, positions and channels, without their limits.
  void mount(std::size_t index, const DeviceDescription&);
  // Takes the sizes of boards that are not there from the file, and checks that the boards leave no holes.
  // Throws likewise.
  void freeze();

  std::uint32_t rows() const { return rows_; }
  std::uint32_t columns() const { return columns_; }
  double pitch() const { return pitch_; }
  const std::vector<TableChannel>& channels() const { return channels_; }
  const std::vector<MountedBoard>& boards() const { return boards_; }
  // By the table's cells; empty: a grid.
  std::vector<std::array<float, 3>> positions() const;

 private:
  [[noreturn]] void fail(std::size_t index, const std::string& what) const;
  MountedBoard place(std::size_t index, std::uint32_t rows, std::uint32_t columns) const;
  std::size_t board_beside(std::uint32_t row, std::uint32_t column) const;
  void require_free(std::size_t index, const MountedBoard&) const;
  void require_same(std::size_t index, const DeviceDescription&) const;
  void enclose(const MountedBoard&);

  const TableSpec& spec_;
  bool frozen_ = false;
  std::uint32_t rows_ = 0, columns_ = 0;
  double pitch_ = 0;
  std::vector<TableChannel> channels_;
  std::vector<MountedBoard> boards_;  // by index; rows 0: not mounted yet
};

// Copies a channel's values between a board and the table, planes of components × cells. Cells that do not
// exist keep the values at the destination.
void copy_to_table(const MountedBoard&, const BoardChannel&, std::uint32_t components, const float* from,
                   float* to, std::size_t table_cells);
void copy_to_board(const MountedBoard&, const BoardChannel&, std::uint32_t components, const float* from,
                   std::size_t table_cells, float* to);

}  // namespace hardware
