#include "smartsurf/view/model/EntityList.h"

#include <gtest/gtest.h>

#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

struct EntityListTest : testing::Test {
  EntityListTest() : scene(6, 9) {
    for (const char* label : {"ball", "", "Ball"}) {
      scene.add_sphere(1.0, 1.0, 6.0, 1.0, {});
      scene.spec.objects.back().label = label;
    }
    scene::ObjectSpec box;
    box.shape = scene::ShapeKind::kBox;
    box.label = "wall";
    box.fixed = true;
    scene.add(box);
  }
  std::vector<std::string> find(const char* query) {
    std::vector<std::string> names;
    for (const Entity& entity :
         list.find(query, scene.spec.surface, {scene.snapshot, scene.spec.objects, channels}))
      names.push_back(entity.name);
    return names;
  }
  TestScene scene;
  std::vector<Channel> channels = {
      {"height", "u", {}}, {"command: height", "u", {}}, {"proximity_hit", "", {}}};
  EntityList list;
};

using Names = std::vector<std::string>;

TEST_F(EntityListTest, ListsChannelsThenObjects) {
  EXPECT_EQ(find(""), (Names{"height [u]", "command: height [u]", "proximity_hit", "0 ball, sphere",
                             "1, sphere", "2 Ball, sphere", "3 wall, box, fixed"}));
}

TEST_F(EntityListTest, MatchesAllWordsRegardlessOfCase) {
  EXPECT_EQ(find("BALL"), (Names{"0 ball, sphere", "2 Ball, sphere"}));
  EXPECT_EQ(find("ball 2"), (Names{"2 Ball, sphere"}));
  EXPECT_EQ(find("hei com"), (Names{"command: height [u]"}));
  EXPECT_EQ(find("fixed"), (Names{"3 wall, box, fixed"}));
  EXPECT_EQ(find("nothing"), Names{});
}

TEST_F(EntityListTest, FindsCellsOfTheSurface) {
  EXPECT_EQ(find("5,8"), (Names{"cell 5,8"}));
  const Entity cell = list.find("5,8", scene.spec.surface, {scene.snapshot, scene.spec.objects, channels})[0];
  EXPECT_EQ(cell.item, (SceneItem{SceneItem::Kind::kCell, 0, 5, 8}));
  EXPECT_EQ(find("6,0"), Names{});
  EXPECT_EQ(find("0,9"), Names{});
  EXPECT_EQ(find("-1,0"), Names{});
}

TEST_F(EntityListTest, FollowsTheObjectsOfTheFrame) {
  EXPECT_EQ(find("sphere").size(), 3u);
  scene.snapshot.id.erase(scene.snapshot.id.begin());  // object 0 has left
  EXPECT_EQ(find("sphere"), (Names{"1, sphere", "2 Ball, sphere"}));
}

}  // namespace
}  // namespace smartsurf::view
