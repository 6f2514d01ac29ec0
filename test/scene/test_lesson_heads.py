# SPDX-License-Identifier: MIT
"""The heads of the bundled scenes are lessons: they have what pages and documents show."""

from rigid_proto_ros.base.bundled import example_names, scene_names
from rigid_proto_ros.scene.lessons import lessons


def test_every_bundled_scene_is_a_lesson_with_a_title_a_question_three_sentences_and_a_reason() -> None:
    found = {one.name: one for one in lessons()}
    assert sorted(found) == scene_names()
    assert len({one.title for one in found.values()}) == len(found)
    for name, one in found.items():
        assert 8 < len(one.title) < 60, name
        assert not one.title.endswith("."), name
        assert one.question.endswith("?"), name
        assert len(set(one.choices)) == 3, name
        assert one.answer in range(3), name
        assert all(20 < len(sentence) < 200 for sentence in one.sentences), name
        assert one.sentences[-1].endswith("."), name
        assert len(one.reason) > 60, name
        assert f"rigid_proto simulate config/{name}.yaml" in one.commands, name
        assert not one.script or one.script in example_names(), name
