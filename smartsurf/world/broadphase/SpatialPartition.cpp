#include "smartsurf/world/broadphase/SpatialPartition.h"

#include <algorithm>

namespace smartsurf::world {
namespace {

constexpr int kMinBodiesPerSlab = 128, kMaxSlabs = 64;  // approximate
constexpr int kMinLines = 24;                           // cut along y if there are at least this many lines

}  // namespace

void SpatialPartition::build(const UniformGrid& grid, int bodies) {
  if (std::ssize(row_of_body_) != bodies) row_of_body_.assign(bodies, 0);
  if (!first_row_.empty()) first_row_.back() -= added_rows_;
  added_rows_ = 0;
  // A single slab of the grid's bodies depends on their number only.
  const auto large_count = static_cast<int>(grid.large_bodies().size());
  if (grid.sorted_count() < 2 * kMinBodiesPerSlab && slab_count() == 2 &&
      rows_of(0).end == grid.sorted_count() && row_count() == grid.sorted_count() + large_count)
    return;
  // Lines along x are contiguous in memory, so cut between them unless there are too few.
  const int axis = grid.cell_count(1) >= std::min(kMinLines, grid.cell_count(0)) ? 1 : 0;
  find_slab_edges(grid, axis);
  find_body_runs(grid, axis);
  const int slabs = static_cast<int>(slab_edge_.size());  // one more for the large bodies
  body_run_.push_back({grid.sorted_count(), grid.sorted_count(), slabs - 1});
  group_body_runs(slabs);
  first_row_.assign(slabs + 1, 0);
  for (const BodyRun& p : body_run_) first_row_[p.slab + 1] += p.end - p.begin;
  first_row_.back() += static_cast<std::int32_t>(grid.large_bodies().size());
  for (std::size_t s = 1; s < first_row_.size(); ++s) first_row_[s] += first_row_[s - 1];
  weight_prefix_.assign(first_row_.begin(), first_row_.end());
  active_end_.resize(slabs);
  body_of_row_.resize(row_count());
}

void SpatialPartition::count_bodies_on_lines(const UniformGrid& grid, int axis) {
  lines_.clear();
  const auto rows = grid.rows();
  for (std::size_t r = 0; r + 1 < rows.size(); ++r) {
    if (axis == 1) {
      lines_.push_back({rows[r].y, rows[r + 1].begin - rows[r].begin});
      continue;
    }
    for (int k = rows[r].begin; k < rows[r + 1].begin; ++k)
      if (k > rows[r].begin && grid.column(k) == lines_.back().at)
        ++lines_.back().bodies;
      else
        lines_.push_back({grid.column(k), 1});
  }
  std::ranges::sort(lines_, {}, &Line::at);
}

// A slab takes whole lines of cells until it has enough bodies.
void SpatialPartition::find_slab_edges(const UniformGrid& grid, int axis) {
  slab_edge_.assign(1, 0);
  const int line_count = grid.cell_count(axis);
  if (grid.sorted_count() >= 2 * kMinBodiesPerSlab) {
    count_bodies_on_lines(grid, axis);
    const int target_bodies = std::max(kMinBodiesPerSlab, grid.sorted_count() / kMaxSlabs);
    int bodies = 0;
    for (std::size_t i = 0; i < lines_.size() && lines_[i].at + 1 < line_count; ++i) {
      bodies += lines_[i].bodies;
      const bool ends_line = i + 1 == lines_.size() || lines_[i + 1].at > lines_[i].at;
      if (!ends_line || bodies < target_bodies) continue;
      slab_edge_.push_back(lines_[i].at + 1);
      bodies = 0;
    }
  }
  slab_edge_.push_back(line_count);
}

// Bodies that follow each other in the same layer and slab, on one row unless slabs hold whole rows.
void SpatialPartition::find_body_runs(const UniformGrid& grid, int axis) {
  body_run_.clear();
  const int slabs = static_cast<int>(slab_edge_.size()) - 1;
  if (slabs == 1) {
    if (grid.sorted_count() > 0) body_run_.push_back({0, grid.sorted_count(), 0});
    return;
  }
  const auto rows = grid.rows();
  int slab = 0;
  auto add = [&](int begin, int end, int line, bool continues) {
    if (!continues) slab = 0;
    const int previous = slab;
    while (line >= slab_edge_[slab + 1]) ++slab;
    if (continues && slab == previous)
      body_run_.back().end = end;
    else
      body_run_.push_back({begin, end, slab});
  };
  for (std::size_t r = 0; r + 1 < rows.size(); ++r) {
    if (axis == 1) {
      add(rows[r].begin, rows[r + 1].begin, rows[r].y, r > 0 && rows[r].z == rows[r - 1].z);
      continue;
    }
    for (int k = rows[r].begin; k < rows[r + 1].begin; ++k) add(k, k + 1, grid.column(k), k > rows[r].begin);
  }
}

// A counting sort of the body runs by slab.
void SpatialPartition::group_body_runs(int slabs) {
  first_run_of_slab_.assign(slabs + 1, 0);
  for (const BodyRun& p : body_run_) ++first_run_of_slab_[p.slab + 1];
  for (std::size_t s = 1; s < first_run_of_slab_.size(); ++s)
    first_run_of_slab_[s] += first_run_of_slab_[s - 1];
  runs_by_slab_.resize(body_run_.size());
  for (std::size_t p = 0; p < body_run_.size(); ++p)
    runs_by_slab_[first_run_of_slab_[body_run_[p].slab]++] = static_cast<std::int32_t>(p);
  for (std::size_t s = first_run_of_slab_.size() - 1; s > 0; --s)
    first_run_of_slab_[s] = first_run_of_slab_[s - 1];
  first_run_of_slab_[0] = 0;
}

void SpatialPartition::set_contact_counts(std::span<const std::size_t> contacts) {
  constexpr long kBodyCost = 3, kContactCost = 2;  // relative cost, measured roughly
  for (std::size_t s = 0; s < contacts.size(); ++s)
    weight_prefix_[s + 1] = weight_prefix_[s] + kBodyCost * (first_row_[s + 1] - first_row_[s]) +
                            kContactCost * static_cast<long>(contacts[s]);
}

// Cuts at the slab boundaries nearest to even shares of the weight.
IndexRange SpatialPartition::share(const Member& member) const {
  auto slab_at = [&](int index) {
    const long wanted = weight_prefix_.back() * index / member.member_count;
    const auto after = std::lower_bound(weight_prefix_.begin(), weight_prefix_.end(), wanted);
    const bool nearer_before = after != weight_prefix_.begin() && wanted - *(after - 1) < *after - wanted;
    return static_cast<int>(after - weight_prefix_.begin()) - (nearer_before ? 1 : 0);
  };
  return {member.index == 0 ? 0 : slab_at(member.index),
          member.index + 1 == member.member_count ? slab_count() : slab_at(member.index + 1)};
}

void SpatialPartition::add_row(std::int32_t body) {
  const std::int32_t first_added = row_count() - added_rows_, known = row_of_body_[body];
  if (known >= first_added && known < row_count() && body_of_row_[known] == body) return;
  row_of_body_[body] = row_count();
  body_of_row_.resize(row_count());
  body_of_row_.push_back(body);
  ++first_row_.back();
  ++added_rows_;
}

void SpatialPartition::assign_rows(const BodyStore& bodies, const UniformGrid& grid, const Member& member) {
  const IndexRange own_slabs = share(member);
  for (int s = own_slabs.begin; s < own_slabs.end; ++s) {
    const IndexRange rows = rows_of(s);
    int active_end = rows.begin, inactive_begin = rows.end;
    auto assign = [&](std::int32_t body) {
      const int row = bodies.is_active(body) ? active_end++ : --inactive_begin;
      body_of_row_[row] = body;
      row_of_body_[body] = row;
    };
    for (const std::int32_t p : body_runs_of(s)) {
      const BodyRun& run = body_run_[p];
      for (int k = run.begin; k < run.end; ++k) assign(grid.body(k));
    }
    if (s + 1 == slab_count())
      for (const std::int32_t body : grid.large_bodies()) assign(body);
    active_end_[s] = active_end;
  }
}

}  // namespace smartsurf::world
