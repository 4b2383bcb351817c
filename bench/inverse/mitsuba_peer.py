"""The fit of bench_inverse's first asset by Mitsuba 3, on this machine's processor, beside patina's figures.

    python3 -m venv peers && peers/bin/pip install mitsuba numpy
    peers/bin/python bench/inverse/mitsuba_peer.py --report build/bench/inverse.json

Same triangles, cameras, environment, loss and start; Mitsuba's own `principled` BSDF, its own targets rendered with it, variant
llvm_ad_rgb, integrator prb, Adam. Textures are shrunk to two texels a pixel of a view's side, as patina's fit does by itself: at
full size most texels are met by no path, and the others follow single ones. A step renders one view (drawn at random), which
converges sooner than steps over all nine. Stops when the base colours are as near to the truth as patina's, or after --minutes: then mitsuba_over_patina is
a lower bound, and mitsuba_reached says false. Before that it renders the views with both and compares time at equal noise. Adds mitsuba_* to the report.

Where LLVM fails ("Cannot select"), it is older than the processor: DRJIT_LIBLLVM_PATH names a newer libLLVM.so (Debian: libllvm19).
"""

import argparse
import json
import pathlib
import random
import time

import numpy as np


def srgb(x):
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--report", type=pathlib.Path, required=True)
    parser.add_argument("--scene", type=pathlib.Path, help="default: the folder `scene` beside the report's pictures")
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--spp", type=int, default=8, help="paths a pixel of a step")
    parser.add_argument("--target-spp", type=int, default=128)
    parser.add_argument("--rate", type=float, default=0.02)
    arguments = parser.parse_args()

    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    folder = arguments.scene or arguments.report.parent / "inverse" / "scene"
    scene_json = json.loads((folder / "scene.json").read_text())
    report = json.loads(arguments.report.read_text())

    def array(name, dtype, *shape):
        return np.fromfile(folder / name, dtype).reshape(shape)

    p, n = array("p.f32", np.float32, -1, 3), array("n.f32", np.float32, -1, 3)
    uv, triangles = array("uv.f32", np.float32, -1, 2), array("triangles.u32", np.uint32, -1, 3)
    truth = {
        "base_color": array("base_color.f32", np.float32, *scene_json["base_color"], 3),
        "roughness": array("roughness.f32", np.float32, *scene_json["roughness"], 1),
        "metallic": array("metallic.f32", np.float32, *scene_json["metallic"], 1),
    }
    counted = array("counted.f32", np.float32, *scene_json["base_color"]) > 0
    resolution = scene_json["resolution"]

    def shrunk(values):
        factor = max(1, values.shape[0] // (2 * resolution))
        height, width = values.shape[0] // factor, values.shape[1] // factor
        pooled = values[: height * factor, : width * factor].reshape(height, factor, width, factor, -1).mean((1, 3))
        return np.ascontiguousarray(pooled, np.float32)

    truth = {name: shrunk(values) for name, values in truth.items()}
    counted = shrunk(counted[..., None].astype(np.float32))[..., 0] > 0.5

    def texture(values):
        return {"type": "bitmap", "bitmap": mi.Bitmap(values), "raw": True, "filter_type": "bilinear", "format": "variant"}

    bsdf = mi.load_dict({"type": "twosided", "bsdf": {"type": "principled", "specular": 0.5, **{k: texture(v) for k, v in truth.items()}}})
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    mesh = mi.Mesh("asset", len(p), len(triangles), has_vertex_normals=True, has_vertex_texcoords=True, props=properties)
    mesh_parameters = mi.traverse(mesh)
    mesh_parameters["vertex_positions"] = p.ravel()
    mesh_parameters["vertex_normals"] = n.ravel()
    # Rows of a bitmap run down from v = 0 as glTF's do.
    mesh_parameters["vertex_texcoords"] = uv.ravel()
    mesh_parameters["faces"] = triangles.ravel()
    mesh_parameters.update()
    environment = array("environment.f32", np.float32, *scene_json["environment"], 3)
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "prb", "max_depth": 5, "hide_emitters": True},
        "light": {"type": "envmap", "bitmap": mi.Bitmap(environment)},
        "asset": mesh,
    })
    sensors = []
    for camera in scene_json["cameras"]:
        matrix = np.array(camera["world_from_camera"], np.float32).reshape(4, 4)
        matrix[:, [0, 2]] *= -1  # Mitsuba's cameras look along +Z with +X to the left
        sensors.append(mi.load_dict({
            "type": "perspective",
            "fov": float(np.degrees(camera["fov_y"])),
            "fov_axis": "y",
            "near_clip": 1e-4,
            "to_world": mi.ScalarTransform4f(matrix.tolist()),
            "film": {"type": "hdrfilm", "width": resolution, "height": resolution, "rfilter": {"type": "box"}},
        }))

    # Renders at equal noise: time × variance of the same views, against patina's.
    def render_all(seed):
        return [np.array(mi.render(scene, integrator=path_integrator, sensor=s, spp=report["render"]["samples"], seed=seed)) for s in sensors]

    def inside(mask):  # without the pixels at the silhouette
        core = mask.copy()
        for axis in (0, 1):
            core &= np.roll(mask, 1, axis) & np.roll(mask, -1, axis)
        return core

    path_integrator = mi.load_dict({"type": "path", "max_depth": 5, "hide_emitters": True})
    render_all(1)  # compiles the kernels
    begin = time.perf_counter()
    first = render_all(2)
    render_seconds = time.perf_counter() - begin
    second = render_all(3)
    covered = [inside(a.sum(-1) > 0) for a in first]
    variance = np.concatenate([((a - b) ** 2 / 2)[m].ravel() for a, b, m in zip(first, second, covered)])
    radiance = np.concatenate([a[m].ravel() for a, m in zip(first, covered)])
    noise = float(np.sqrt(variance.mean()) / radiance.mean())
    ours = report["render"]
    report["mitsuba_render"] = {"samples": ours["samples"], "seconds": render_seconds, "relative_noise": noise}
    report["mitsuba_over_patina_render"] = render_seconds * noise**2 / (ours["seconds"] * ours["relative_noise"] ** 2)
    arguments.report.write_text(json.dumps(report, indent=1) + "\n")
    print(f"renders: Mitsuba {render_seconds:.1f} s, noise {noise:.3f}; patina {ours['seconds']:.1f} s, {ours['relative_noise']:.3f}: "
          f"at equal noise Mitsuba takes {report['mitsuba_over_patina_render']:.2f} times as long")

    gain = 2.0 ** scene_json["exposure_ev"]

    def tone_mapped(radiance):
        scaled = gain * radiance
        return scaled / (1 + scaled)

    targets = [dr.detach(tone_mapped(mi.render(scene, sensor=s, spp=arguments.target_spp, seed=1000 + i))) for i, s in enumerate(sensors)]
    dr.eval(targets)

    parameters = mi.traverse(scene)
    keys = {name: next(k for k in parameters.keys() if k.endswith(f"{name}.data")) for name in ("base_color", "roughness")}
    for name, key in keys.items():
        start = np.broadcast_to(truth[name].mean((0, 1)), truth[name].shape)
        parameters[key] = mi.TensorXf(np.ascontiguousarray(start))
    parameters.update()
    optimizer = mi.ad.Adam(lr=arguments.rate)
    for key in keys.values():
        optimizer[key] = parameters[key]
    parameters.update(optimizer)

    def psnr():
        found = np.array(parameters[keys["base_color"]]).reshape(truth["base_color"].shape)
        difference = srgb(found) - srgb(truth["base_color"])
        return -10 * np.log10((difference[counted] ** 2).mean())

    goal, patina_seconds = report["assets"][0]["base_color_psnr"], report["seconds_9x512"]
    curve, spent, step, found = [], 0.0, 0, psnr()
    print(f"start {found:.2f} dB, goal {goal:.2f} dB")
    order = random.Random(0)
    while found < goal and spent < 60 * arguments.minutes:
        begin = time.perf_counter()
        view = order.randrange(len(sensors))
        image = tone_mapped(mi.render(scene, parameters, sensor=sensors[view], spp=arguments.spp, seed=step))
        error = dr.square(image - targets[view]) / (dr.square(dr.detach(image)) + 0.01)
        dr.backward(dr.mean(error, axis=None))
        optimizer.step()
        for key in keys.values():
            optimizer[key] = dr.clip(optimizer[key], 0.03 if "roughness" in key else 0.0, 1.0)
        parameters.update(optimizer)
        dr.eval(optimizer[keys["base_color"]])
        dr.sync_thread()
        spent += time.perf_counter() - begin
        step += 1
        if step % 20 == 0 or spent >= 60 * arguments.minutes:
            found = psnr()
            curve.append([spent, float(found)])
            print(f"step {step}  {spent:.0f} s  {found:.2f} dB", flush=True)

    report["mitsuba_seconds"] = spent
    report["mitsuba_steps"] = step
    # In the end the textures may fit noise: the best on the way counts.
    report["mitsuba_best_psnr"] = float(max(value for _, value in curve))
    report["mitsuba_reached"] = bool(found >= goal)
    report["mitsuba_curve"] = curve
    report["mitsuba_over_patina"] = spent / patina_seconds
    arguments.report.write_text(json.dumps(report, indent=1) + "\n")
    print(f"Mitsuba {'reached' if found >= goal else 'had not reached'} {goal:.2f} dB after {spent:.0f} s; patina took {patina_seconds:.0f} s")


if __name__ == "__main__":
    main()
