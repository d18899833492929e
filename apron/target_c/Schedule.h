// Orders the values of a region into exchanges between neighbours and kernels over the cells of a tile, and
// gives planes their places in memory.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "apron/target_c/TileGraph.h"

namespace apron::target_c {

// How a plane lies in memory. Values that are 0 or 1 take a byte per cell whatever their type.
enum class Storage : std::uint8_t { kTruth, kFloat, kInt32, kUint16, kUint8 };
inline constexpr std::array kStorages{Storage::kTruth, Storage::kFloat, Storage::kInt32, Storage::kUint16,
                                      Storage::kUint8};
struct StorageInfo {
  const char *name, *c_type;  // of the array in the state; of its cells
  std::size_t bytes;
};
constexpr StorageInfo storage_info(Storage storage) {
  constexpr std::array<StorageInfo, 5> kInfos{{{"truths", "uint8_t", 1},
                                               {"numbers", "float", 4},
                                               {"int32s", "int32_t", 4},
                                               {"uint16s", "uint16_t", 2},
                                               {"uint8s", "uint8_t", 1}}};
  return kInfos[static_cast<std::size_t>(storage)];
}
constexpr Storage storage_of(program::CellType type, bool is_truth) {
  return is_truth ? Storage::kTruth : static_cast<Storage>(1 + static_cast<int>(type));
}

// Planes that neighbours read have a margin.
struct Layout {
  Storage storage = Storage::kFloat;
  bool has_margin = false;
  bool is_truth() const { return storage == Storage::kTruth; }
  auto operator<=>(const Layout&) const = default;
};

// A plane of the tile's state: number `index` of those of its layout.
struct Place {
  Layout layout;
  std::uint32_t index = 0;
  auto operator<=>(const Place&) const = default;
};

// Computes nodes for all cells of the tile and `extent` cells around it.
struct Kernel {
  std::vector<NodeId>
      nodes;  // in order; includes those that the kernel computes again instead of loading them
  std::vector<NodeId> outputs;  // nodes that are stored, in order
  std::uint32_t extent = 0;
};

// Gives the cells beyond the table's edge the values of the boundary rule of a read.
struct Imposition {
  NodeId value = kNoNode;
  NodeId read = kNoNode;  // a kRead: its rule
};

// The cells beyond the tile's border that are needed: up to so many columns or rows beyond each side (west,
// east, north, south), and beyond two sides so many of both together (north-west, north-east, south-west,
// south-east).
struct Reach {
  std::array<std::uint32_t, 4> sides{}, corners{};
  std::uint32_t most() const { return std::ranges::max(sides); }
  bool has_corners() const;
  // The reach of a value that is read at (dx, dy) from each cell that needs this reach.
  Reach moved(int dx, int dy) const;
  void add(const Reach& other);
};

// The cells of a value that a tile receives.
struct Strip {
  NodeId value = kNoNode;
  Reach reach;
};

// One round of messages. With corners west and east come first, then north and south with what west and east
// brought.
struct Exchange {
  std::vector<Strip> strips;
  bool has_corners = false;
};

struct Step {
  enum class Kind : std::uint8_t { kKernel, kImpose, kExchange } kind = Kind::kKernel;
  Kernel kernel;
  Imposition imposition;
  Exchange exchange;
  std::map<NodeId, Place> places;  // of the values that the step loads and stores
};

// A plane that is copied where the region ends.
struct Move {
  Place from, to;
};

struct RegionSchedule {
  std::vector<NodeId> scalars;  // known at run time only: computed where the region begins
  std::vector<Step> steps;
  std::vector<Move> moves;
  std::vector<bool> is_truth;                                 // by node
  std::vector<std::pair<std::uint32_t, NodeId>> scalars_out;  // those that a later region reads
};

struct Schedule {
  std::vector<RegionSchedule> regions;
  std::map<Layout, std::uint32_t> planes;  // how many
  std::map<std::uint32_t, Place> homes;    // of the homes that some region reads
  std::vector<bool> scalar_is_live;        // by slot
};

// `halo`: the cells that an exchange brings; a value is computed again beyond the tile's border until they
// are used up.
Schedule schedule(TileProgram& program, std::uint32_t halo);

}  // namespace apron::target_c
