// Checks that a mesh is closed, and orients its shells. A shell is a set of triangles connected by edges with
// two triangles. An edge with more triangles (two cubes that touch along an edge) does not connect shells;
// each shell must be balanced there on its own.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <sstream>

#include "smartsurf/mesh/TriangleMesh.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {
namespace {

// Shells are compared in pairs.
constexpr std::size_t kMaxShells = 20'000;
constexpr std::int64_t kMaxNestingWork = 50'000'000;  // triangles of shells around others

struct HalfEdge {
  std::uint32_t low, high;  // points of the edge
  std::uint32_t triangle;
  bool forward;  // directed from low to high
};
using HalfEdges = std::vector<HalfEdge>;

HalfEdges half_edges_of(const TriangleMesh& mesh) {
  HalfEdges half_edges;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = mesh.triangles[t][i], b = mesh.triangles[t][(i + 1) % 3];
      half_edges.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  std::sort(half_edges.begin(), half_edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    if (a.low != b.low) return a.low < b.low;
    return a.high != b.high ? a.high < b.high : a.triangle < b.triangle;
  });
  return half_edges;
}

template <typename Visit>
void for_each_edge(const HalfEdges& half_edges, Visit visit) {
  for (auto first = half_edges.begin(); first != half_edges.end();) {
    auto end = first;
    while (end != half_edges.end() && end->low == first->low && end->high == first->high) ++end;
    visit(std::span<const HalfEdge>(&*first, end - first));
    first = end;
  }
}

std::string edge_text(const TriangleMesh& mesh, const HalfEdge& half_edge) {
  std::ostringstream out;
  const auto point = [&](std::uint32_t i) -> std::ostream& {
    const Eigen::Vector3d& p = mesh.points[i];
    return out << '(' << p.x() << ", " << p.y() << ", " << p.z() << ')';
  };
  out << "from ";
  point(half_edge.low) << " to ";
  point(half_edge.high);
  return out.str();
}

// Counts invalid edges and keeps the one of the first triangle in the file.
struct BadEdges {
  std::size_t count = 0;
  HalfEdge first{};
  void add(const HalfEdge& half_edge) {
    if (count++ == 0 || half_edge.triangle < first.triangle) first = half_edge;
  }
  std::string text(const TriangleMesh& mesh, const std::string& singular, const std::string& plural) const {
    return std::to_string(count) + (count == 1 ? " " + singular : " " + plural) + ", the first " +
           edge_text(mesh, first);
  }
};

void require_closed(const TriangleMesh& mesh, const HalfEdges& half_edges) {
  BadEdges open;
  for_each_edge(half_edges, [&](std::span<const HalfEdge> edge) {
    if (edge.size() == 1) open.add(edge.front());
  });
  if (open.count > 0)
    throw scene::InputError(
        "the mesh is open: " + open.text(mesh, "edge has only one triangle", "edges have only one triangle") +
        "; close its holes in a mesh editor, or use its convex hull, hull{file = ...}");
}

// Finds the shells and the triangles to flip so that adjacent triangles traverse their common edge in
// opposite directions. A union-find structure over triangles, with the parity to the parent per triangle.
class ShellOrientation {
 public:
  ShellOrientation(const TriangleMesh& mesh, const HalfEdges& half_edges)
      : mesh_(mesh), parent_(mesh.triangles.size()), parity_(mesh.triangles.size(), 0) {
    std::iota(parent_.begin(), parent_.end(), 0U);
    for_each_edge(half_edges, [&](std::span<const HalfEdge> edge) {
      if (edge.size() == 2) unite(edge[0], edge[1]);
    });
    BadEdges branched;
    for_each_edge(half_edges, [&](std::span<const HalfEdge> edge) {
      if (edge.size() > 2 && !is_balanced(edge)) branched.add(edge.front());
    });
    if (branched.count > 0)
      throw scene::InputError(
          "the inside of the mesh is ambiguous: " +
          branched.text(mesh, "edge joins three or more triangles", "edges join three or more triangles") +
          "; remove inner walls and repeated faces in a mesh editor, or use its convex hull, hull{file = "
          "...}");
  }

  std::uint32_t shell(std::uint32_t triangle) { return find(triangle).first; }
  bool is_flipped(std::uint32_t triangle) { return find(triangle).second; }

 private:
  // The representative triangle of the shell, and whether `t` is oriented opposite to it.
  std::pair<std::uint32_t, bool> find(std::uint32_t t) {
    bool parity = false;
    while (parent_[t] != t) {
      const std::uint32_t up = parent_[t];
      parity ^= parity_[t] != 0;
      if (parent_[up] != up) {  // path halving
        parity_[t] ^= parity_[up];
        parent_[t] = parent_[up];
        parity ^= parity_[up] != 0;
        t = parent_[t];
      } else {
        t = up;
      }
    }
    return {t, parity};
  }

  void unite(const HalfEdge& a, const HalfEdge& b) {
    const auto [shell_a, parity_a] = find(a.triangle);
    const auto [shell_b, parity_b] = find(b.triangle);
    const bool opposed = a.forward == b.forward;
    if (shell_a == shell_b) {
      if ((parity_a != parity_b) != opposed)
        throw scene::InputError("the mesh has only one side, like a Moebius strip, at the edge " +
                                edge_text(mesh_, a) + ": it encloses nothing");
      return;
    }
    const auto [low, high] = std::minmax(shell_a, shell_b);
    parent_[high] = low;
    parity_[high] = static_cast<char>((parity_a != parity_b) != opposed);
  }

  // True if every shell has as many triangles in the forward as in the backward direction at the edge.
  bool is_balanced(std::span<const HalfEdge> edge) {
    for (const HalfEdge& one : edge) {
      int sum = 0;
      for (const HalfEdge& other : edge)
        if (shell(other.triangle) == shell(one.triangle))
          sum += other.forward != is_flipped(other.triangle) ? 1 : -1;
      if (sum != 0) return false;
    }
    return true;
  }

  const TriangleMesh& mesh_;
  std::vector<std::uint32_t> parent_;
  std::vector<char> parity_;
};

double signed_volume(const TriangleMesh& mesh) {
  double six_volumes = 0.0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d origin = mesh.points[mesh.triangles[0][0]];
    six_volumes +=
        (mesh.points[t[0]] - origin).dot((mesh.points[t[1]] - origin).cross(mesh.points[t[2]] - origin));
  }
  return six_volumes / 6.0;
}

void flip(std::array<std::uint32_t, 3>& triangle) { std::swap(triangle[1], triangle[2]); }

// A shell as a separate mesh.
struct Shell {
  TriangleMesh mesh;
  std::vector<std::uint32_t> triangles;  // indices in the source mesh
  Eigen::AlignedBox3d box;
};

// Moves the triangles, which refer to `all`, to those of the points that they use, in the same order.
void take_points(TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& all) {
  std::vector<std::uint32_t> used;
  for (const auto& t : mesh.triangles) used.insert(used.end(), t.begin(), t.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (const std::uint32_t p : used) mesh.points.push_back(all[p]);
  for (auto& t : mesh.triangles)
    for (std::uint32_t& p : t)
      p = static_cast<std::uint32_t>(std::lower_bound(used.begin(), used.end(), p) - used.begin());
}

std::vector<Shell> split_shells(const TriangleMesh& mesh, ShellOrientation& orientation) {
  std::vector<Shell> shells;
  std::vector<std::uint32_t> number(mesh.triangles.size(), UINT32_MAX);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    std::uint32_t& n = number[orientation.shell(t)];
    if (n == UINT32_MAX) {
      n = static_cast<std::uint32_t>(shells.size());
      shells.emplace_back();
    }
    shells[n].triangles.push_back(t);
    shells[n].mesh.triangles.push_back(mesh.triangles[t]);
  }
  for (Shell& shell : shells) {
    take_points(shell.mesh, mesh.points);
    shell.box = bounding_box(shell.mesh);
  }
  return shells;
}

// A point of the shell and its extreme ones along the axes.
std::vector<Eigen::Vector3d> probe_points(const Shell& shell) {
  const std::vector<Eigen::Vector3d>& points = shell.mesh.points;
  std::vector<Eigen::Vector3d> probes{points.front()};
  for (int axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::ranges::minmax_element(points, {}, [&](const auto& p) { return p[axis]; });
    probes.push_back(*low);
    probes.push_back(*high);
  }
  return probes;
}

// The number of shells that enclose this one; one that is only crossed, as by a handle whose ends lie in the
// wall of a mug, does not. `work`: what may still be done, in triangles.
int nesting_depth(const std::vector<Shell>& shells, std::size_t which, std::int64_t& work) {
  constexpr double kInsideThreshold = 0.75;
  const std::vector<Eigen::Vector3d> probes = probe_points(shells[which]);
  const auto encloses = [&](const Shell& outer) {
    return std::ranges::all_of(probes, [&](const Eigen::Vector3d& point) {
      if (!outer.box.contains(point)) return false;
      work -= static_cast<std::int64_t>(outer.mesh.triangles.size());
      if (work < 0) throw scene::InputError("has too many shells within others: simplify it");
      return std::abs(winding_number(outer.mesh, point)) > kInsideThreshold;
    });
  };
  int depth = 0;
  for (std::size_t i = 0; i < shells.size(); ++i) depth += i != which && encloses(shells[i]);
  return depth;
}

std::string format_count(std::size_t n, const std::string& singular, const std::string& plural) {
  return std::to_string(n) + " " + (n == 1 ? singular : plural);
}

}  // namespace

std::vector<std::string> orient_shells(TriangleMesh& mesh) {
  std::vector<std::string> repairs;
  const HalfEdges half_edges = half_edges_of(mesh);
  require_closed(mesh, half_edges);
  ShellOrientation orientation(mesh, half_edges);
  std::size_t flipped_count = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    if (orientation.is_flipped(t)) {
      flip(mesh.triangles[t]);
      ++flipped_count;
    }
  if (flipped_count > 0)
    repairs.push_back(
        format_count(flipped_count, "triangle faced against its", "triangles faced against their") +
        " neighbours: flipped");

  const std::vector<Shell> shells = split_shells(mesh, orientation);
  if (shells.size() > kMaxShells)
    throw scene::InputError("has " + std::to_string(shells.size()) + " shells: at most " +
                            std::to_string(kMaxShells) + " are allowed; simplify it");
  std::int64_t work = kMaxNestingWork;
  std::size_t inverted_shells = 0;
  for (std::size_t i = 0; i < shells.size(); ++i) {
    const bool cavity = shells.size() > 1 && nesting_depth(shells, i, work) % 2 == 1;
    if ((signed_volume(shells[i].mesh) < 0.0) == cavity) continue;
    ++inverted_shells;
    for (const std::uint32_t t : shells[i].triangles) flip(mesh.triangles[t]);
  }
  if (inverted_shells > 0 && flipped_count == 0)
    repairs.push_back(shells.size() == 1
                          ? "the mesh was inside out: flipped"
                          : format_count(inverted_shells, "shell", "shells") + " of " +
                                std::to_string(shells.size()) + " faced the wrong way: flipped");
  return repairs;
}

}  // namespace smartsurf::mesh
