#include "smartsurf/world/Slabs.h"

#include <algorithm>

namespace smartsurf::world {
namespace {

constexpr int kFewest = 128, kMostSlabs = 64;  // bodies of a slab at least, and slabs, about
constexpr int kLines = 24;                     // so many are enough to share

}  // namespace

void Slabs::cut(const Grid& grid) {
  // Lines along x follow each other in memory; lines across are cut only where there are few of the others.
  const int axis = grid.cells(1) >= std::min(kLines, grid.cells(0)) ? 1 : 0;
  find_edges(grid, axis);
  find_pieces(grid, axis);
  const int slabs = static_cast<int>(edge_.size());  // the large ones are one more
  piece_.push_back({grid.sorted(), grid.sorted(), slabs - 1});
  sort_pieces(slabs);
  first_row_.assign(static_cast<std::size_t>(slabs) + 1, 0);
  for (const Piece& p : piece_) first_row_[static_cast<std::size_t>(p.slab) + 1] += p.end - p.begin;
  first_row_.back() += static_cast<std::int32_t>(grid.large().size());
  for (std::size_t s = 1; s < first_row_.size(); ++s) first_row_[s] += first_row_[s - 1];
  weight_before_.assign(first_row_.begin(), first_row_.end());
  moving_end_.resize(static_cast<std::size_t>(slabs));
  body_of_row_.resize(static_cast<std::size_t>(rows()));
  row_of_body_.resize(body_of_row_.size());
}

// Whole lines of cells, until there are enough bodies on them.
void Slabs::find_edges(const Grid& grid, int axis) {
  edge_.assign(1, 0);
  const int lines = grid.cells(axis);
  if (grid.sorted() >= 2 * kFewest) {
    bodies_on_line_.assign(static_cast<std::size_t>(lines), 0);
    for (int z = 0; z < grid.cells(2); ++z)
      for (int y = 0; y < grid.cells(1); ++y) {
        if (axis == 1) {
          bodies_on_line_[static_cast<std::size_t>(y)] += grid.first_in(0, y + 1, z) - grid.first_in(0, y, z);
          continue;
        }
        for (int x = 0; x < grid.cells(0); ++x)
          bodies_on_line_[static_cast<std::size_t>(x)] += grid.first_in(x + 1, y, z) - grid.first_in(x, y, z);
      }
    const int enough = std::max(kFewest, grid.sorted() / kMostSlabs);
    int bodies = 0;
    for (int line = 0; line + 1 < lines; ++line) {
      bodies += bodies_on_line_[static_cast<std::size_t>(line)];
      if (bodies < enough) continue;
      edge_.push_back(line + 1);
      bodies = 0;
    }
  }
  edge_.push_back(lines);
}

void Slabs::find_pieces(const Grid& grid, int axis) {
  piece_.clear();
  const int slabs = static_cast<int>(edge_.size()) - 1;
  auto add = [this](int begin, int end, int slab) {
    if (begin < end) piece_.push_back({begin, end, slab});
  };
  if (slabs == 1) return add(0, grid.sorted(), 0);
  for (int z = 0; z < grid.cells(2); ++z)
    for (int y = 0; y < (axis == 1 ? 1 : grid.cells(1)); ++y)
      for (int s = 0; s < slabs; ++s) {
        const int from = edge_[static_cast<std::size_t>(s)], to = edge_[static_cast<std::size_t>(s) + 1];
        if (axis == 1)
          add(grid.first_in(0, from, z), grid.first_in(0, to, z), s);
        else
          add(grid.first_in(from, y, z), grid.first_in(to, y, z), s);
      }
}

void Slabs::sort_pieces(int slabs) {
  first_of_slab_.assign(static_cast<std::size_t>(slabs) + 1, 0);
  for (const Piece& p : piece_) ++first_of_slab_[static_cast<std::size_t>(p.slab) + 1];
  for (std::size_t s = 1; s < first_of_slab_.size(); ++s) first_of_slab_[s] += first_of_slab_[s - 1];
  of_slab_.resize(piece_.size());
  for (std::size_t p = 0; p < piece_.size(); ++p)
    of_slab_[first_of_slab_[static_cast<std::size_t>(piece_[p].slab)]++] = static_cast<std::int32_t>(p);
  for (std::size_t s = first_of_slab_.size() - 1; s > 0; --s) first_of_slab_[s] = first_of_slab_[s - 1];
  first_of_slab_[0] = 0;
}

void Slabs::weigh(std::span<const std::size_t> contacts) {
  constexpr long kBody = 3, kContact = 2;  // what they cost, about
  for (std::size_t s = 0; s < contacts.size(); ++s)
    weight_before_[s + 1] = weight_before_[s] + kBody * (first_row_[s + 1] - first_row_[s]) +
                            kContact * static_cast<long>(contacts[s]);
}

// Cut at the borders of slabs that are nearest to even shares.
Range Slabs::share(const Member& member) const {
  auto at = [&](int index) {
    const long wanted = weight_before_.back() * index / member.members;
    const auto after = std::lower_bound(weight_before_.begin(), weight_before_.end(), wanted);
    const bool nearer_before = after != weight_before_.begin() && wanted - *(after - 1) < *after - wanted;
    return static_cast<int>(after - weight_before_.begin()) - (nearer_before ? 1 : 0);
  };
  return {member.index == 0 ? 0 : at(member.index),
          member.index + 1 == member.members ? slabs() : at(member.index + 1)};
}

void Slabs::list_rows(const BodyStore& bodies, const Grid& grid, const Member& member) {
  const Range mine = share(member);
  for (int s = mine.begin; s < mine.end; ++s) {
    const Range rows = rows_of(s);
    int moving = rows.begin, resting = rows.end;
    auto list = [&](std::int32_t body) {
      const auto i = static_cast<std::size_t>(body);
      const int row = bodies.moves(i) ? moving++ : --resting;
      body_of_row_[static_cast<std::size_t>(row)] = body;
      row_of_body_[i] = row;
    };
    for (const std::int32_t p : pieces_of(s)) {
      const Piece& piece = piece_[static_cast<std::size_t>(p)];
      for (int k = piece.begin; k < piece.end; ++k) list(grid.body(k));
    }
    if (s + 1 == slabs())
      for (const std::int32_t body : grid.large()) list(body);
    moving_end_[static_cast<std::size_t>(s)] = moving;
  }
}

}  // namespace smartsurf::world
