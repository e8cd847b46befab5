"""In a process of its own, with the real Bonsai: ``python -m bim_verify.tests.addon.bonsai_round_trip HOUSE SCAN OUT``.

Load a project in Bonsai, verify it (made-up verdicts), overrule one, save in Bonsai. Prints what the file in memory and
Bonsai's objects were like on the way, as JSON. The process is left by ``os._exit``: Bonsai's clean-up may crash.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from typing import Any

import bpy


def main(house: str, scan: str, out: str) -> dict[str, Any]:
    import addon_utils
    import ifcopenshell.util.element

    assert addon_utils.enable("bonsai") is not None, "Bonsai cannot be enabled"
    import bim_verify
    from bim_verify.bim_verify_addon import bonsai, scene
    from bim_verify.core import jobs

    from ..core.factory import fabricate

    bim_verify.register()
    bpy.ops.bim.load_project(filepath=house)
    theirs = {item.name: len(item.data.vertices) for item in bpy.data.objects if item.type == "MESH"}
    jobs.verify = lambda model, *_: fabricate(model)  # type: ignore[assignment]
    ops = bpy.ops.bim_verify
    ops.import_scan(filepath=scan)
    ops.verify()
    items = scene.element_objects(bpy.context.scene)
    file = bonsai.live_file()
    assert file is not None

    def statuses() -> dict[str, str]:
        return {g: ifcopenshell.util.element.get_pset(file.by_guid(g), "BimVerify_Verification", "Status") for g in items}

    verified = statuses()
    first = next(iter(items.values()))
    bpy.ops.object.select_all(action="DESELECT")
    first.hide_set(False)
    first.select_set(True)
    ops.decide(status="CONFIRMED", reason="seen", author="me")
    bpy.ops.bim.save_project(filepath=out, should_save_as=True)
    return {
        "elements": len(items), "statuses": verified, "decided": first["GlobalId"],
        "stand_for": sum(bonsai.global_id(bpy.data.objects[name]) in items for name in theirs),
        "meshes_kept": all(len(bpy.data.objects[name].data.vertices) == n for name, n in theirs.items()),
        "path": bonsai.live_path(),
    }  # fmt: skip


if __name__ == "__main__":
    code = 1
    try:
        print(json.dumps(main(*sys.argv[1:])))
        code = 0
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    os._exit(code)
