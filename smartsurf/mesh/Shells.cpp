// Closedness and orientation. A shell is a set of triangles that hang together by edges of two triangles;
// edges where more than two meet (two cubes that touch along one) do not join shells, unless a shell is not
// closed without them.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "smartsurf/mesh/TriangleMesh.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {
namespace {

struct Side {
  std::uint32_t low, high;  // the edge's points
  std::uint32_t triangle;
  bool forward;  // the triangle runs from low to high
};
using Sides = std::vector<Side>;

Sides sides_of(const TriangleMesh& mesh) {
  Sides sides;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = mesh.triangles[t][i], b = mesh.triangles[t][(i + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    if (a.low != b.low) return a.low < b.low;
    return a.high != b.high ? a.high < b.high : a.triangle < b.triangle;
  });
  return sides;
}

template <typename Visit>
void for_each_edge(const Sides& sides, Visit visit) {
  for (auto first = sides.begin(); first != sides.end();) {
    auto end = first;
    while (end != sides.end() && end->low == first->low && end->high == first->high) ++end;
    visit(std::span<const Side>(first, end));
    first = end;
  }
}

std::string edge_text(const TriangleMesh& mesh, const Side& side) {
  std::ostringstream out;
  const auto point = [&](std::uint32_t i) -> std::ostream& {
    const Eigen::Vector3d& p = mesh.points[i];
    return out << '(' << p.x() << ", " << p.y() << ", " << p.z() << ')';
  };
  out << "from ";
  point(side.low) << " to ";
  point(side.high);
  return out.str();
}

// Counts bad edges, and keeps the one whose triangle comes first in the file.
struct BadEdges {
  std::size_t count = 0;
  Side first{};
  void add(const Side& side) {
    if (count++ == 0 || side.triangle < first.triangle) first = side;
  }
  std::string text(const TriangleMesh& mesh, const std::string& one, const std::string& several) const {
    return std::to_string(count) + (count == 1 ? " " + one : " " + several) + ", the first " +
           edge_text(mesh, first);
  }
};

void refuse_open(const TriangleMesh& mesh, const Sides& sides) {
  BadEdges open;
  for_each_edge(sides, [&](std::span<const Side> edge) {
    if (edge.size() == 1) open.add(edge.front());
  });
  if (open.count > 0)
    throw scene::InputError(
        "the mesh is open: " + open.text(mesh, "edge has one triangle only", "edges have one triangle only") +
        "; close its holes where it was made, or take its convex hull, hull{file = ...}");
}

// Shells, and which triangles have to be turned so that neighbours run along their edge in opposite
// directions.
class Orientation {
 public:
  Orientation(const TriangleMesh& mesh, const Sides& sides)
      : mesh_(mesh), parent_(mesh.triangles.size()), odd_(mesh.triangles.size(), 0) {
    std::iota(parent_.begin(), parent_.end(), 0U);
    for_each_edge(sides, [&](std::span<const Side> edge) {
      if (edge.size() == 2) join(edge[0], edge[1]);
    });
    BadEdges branched;
    for_each_edge(sides, [&](std::span<const Side> edge) {
      if (edge.size() > 2 && !balanced(edge)) branched.add(edge.front());
    });
    if (branched.count > 0)
      throw scene::InputError(
          "the mesh encloses no clear inside: " +
          branched.text(mesh, "edge joins three triangles or more", "edges join three triangles or more") +
          "; remove inner walls and repeated faces where it was made, or take its convex hull, hull{file = "
          "...}");
  }

  std::uint32_t shell(std::uint32_t triangle) { return find(triangle).first; }
  bool turned(std::uint32_t triangle) { return find(triangle).second; }

 private:
  // The triangle that stands for the shell, and whether this one runs against it.
  std::pair<std::uint32_t, bool> find(std::uint32_t t) {
    bool odd = false;
    while (parent_[t] != t) {
      const std::uint32_t up = parent_[t];
      odd ^= odd_[t] != 0;
      if (parent_[up] != up) {  // halves the way for the next
        odd_[t] ^= odd_[up];
        parent_[t] = parent_[up];
        odd ^= odd_[up] != 0;
        t = parent_[t];
      } else {
        t = up;
      }
    }
    return {t, odd};
  }

  void join(const Side& a, const Side& b) {
    const auto [shell_a, odd_a] = find(a.triangle);
    const auto [shell_b, odd_b] = find(b.triangle);
    const bool against = a.forward == b.forward;
    if (shell_a == shell_b) {
      if ((odd_a != odd_b) != against)
        throw scene::InputError("the mesh has one side only, like a Moebius strip, at the edge " +
                                edge_text(mesh_, a) + ": it encloses nothing");
      return;
    }
    const auto [low, high] = std::minmax(shell_a, shell_b);
    parent_[high] = low;
    odd_[high] = static_cast<char>((odd_a != odd_b) != against);
  }

  // Within every shell, as many triangles run forward along the edge as backward.
  bool balanced(std::span<const Side> edge) {
    for (const Side& one : edge) {
      int sum = 0;
      for (const Side& other : edge)
        if (shell(other.triangle) == shell(one.triangle))
          sum += other.forward != turned(other.triangle) ? 1 : -1;
      if (sum != 0) return false;
    }
    return true;
  }

  const TriangleMesh& mesh_;
  std::vector<std::uint32_t> parent_;
  std::vector<char> odd_;
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

void turn(std::array<std::uint32_t, 3>& triangle) { std::swap(triangle[1], triangle[2]); }

// The shells as meshes of their own (all with the points of the whole), and the triangles of each.
struct Shell {
  TriangleMesh mesh;
  std::vector<std::uint32_t> triangles;
};

std::vector<Shell> split_shells(const TriangleMesh& mesh, Orientation& orientation) {
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
    shell.mesh.points = mesh.points;
    join_points(shell.mesh, 0.0);  // its own points only
  }
  return shells;
}

// How many other shells hold this one.
int depth_of(const std::vector<Shell>& shells, std::size_t which) {
  constexpr double kSurelyInside = 0.75;
  const Eigen::Vector3d& point = shells[which].mesh.points.front();
  int depth = 0;
  for (std::size_t i = 0; i < shells.size(); ++i)
    depth += i != which && std::abs(winding_number(shells[i].mesh, point)) > kSurelyInside;
  return depth;
}

std::string counted(std::size_t n, const std::string& one, const std::string& several) {
  return std::to_string(n) + " " + (n == 1 ? one : several);
}

}  // namespace

std::vector<std::string> close_and_orient(TriangleMesh& mesh) {
  std::vector<std::string> turned;
  const Sides sides = sides_of(mesh);
  refuse_open(mesh, sides);
  Orientation orientation(mesh, sides);
  std::size_t against = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    if (orientation.turned(t)) {
      turn(mesh.triangles[t]);
      ++against;
    }
  if (against > 0)
    turned.push_back(counted(against, "triangle faced", "triangles faced") +
                     " against the neighbours: turned");

  const std::vector<Shell> shells = split_shells(mesh, orientation);
  std::size_t inside_out = 0;
  for (std::size_t i = 0; i < shells.size(); ++i) {
    const bool cavity = shells.size() > 1 && depth_of(shells, i) % 2 == 1;
    if ((signed_volume(shells[i].mesh) < 0.0) == cavity) continue;
    ++inside_out;
    for (const std::uint32_t t : shells[i].triangles) turn(mesh.triangles[t]);
  }
  if (inside_out > 0 && against == 0)
    turned.push_back(shells.size() == 1 ? "the mesh was inside out: turned"
                                        : counted(inside_out, "shell", "shells") + " of " +
                                              std::to_string(shells.size()) + " faced the wrong way: turned");
  return turned;
}

}  // namespace smartsurf::mesh
