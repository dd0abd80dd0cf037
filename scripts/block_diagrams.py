"""Draws the block diagrams of docs/controllers.md into docs/img/controllers, with the numbers of controllers/gains.

    python3 scripts/block_diagrams.py
"""

import html
import os
import tomllib

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PICTURES = os.path.join(ROOT, "docs/img/controllers")
HEAD = """<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">
<title>{title}</title>
<style>
text {{ font: 13px sans-serif; fill: #1b1f24; text-anchor: middle; dominant-baseline: central; }}
.start {{ text-anchor: start; }} .end {{ text-anchor: end; }} .small {{ font-size: 11px; fill: #57606a; }}
.head {{ font-weight: bold; text-anchor: start; }}
.box {{ fill: #f6f8fa; stroke: #1b1f24; }} .gain {{ fill: #fff1e0; stroke: #bc6c00; }} .limit {{ fill: #eaf5ea; stroke: #2a7d2e; }}
.wire {{ fill: none; stroke: #1b1f24; }} .ground {{ fill: #ffffff; }}
</style>
<defs><marker id="tip" viewBox="0 0 8 8" refX="7.5" refY="4" markerWidth="8" markerHeight="8" orient="auto"><path d="M0 0 L8 4 L0 8 z"/></marker></defs>
<rect class="ground" width="{width}" height="{height}"/>
"""


class Drawing:
    """An SVG of blocks whose centres are given in pixels."""

    def __init__(self, name, title, width, height):
        self.name, self.parts = name, [HEAD.format(width=width, height=height, title=html.escape(title))]

    def text(self, x, y, text, kind=""):
        self.parts.append(f'<text class="{kind}" x="{x}" y="{y}">{html.escape(text)}</text>')

    def block(self, x, y, text, width=96, kind="box", height=36):
        lines = text.split("\n")
        self.parts.append(f'<rect class="{kind}" x="{x - width / 2}" y="{y - height / 2}" width="{width}" height="{height}" rx="3"/>')
        for index, line in enumerate(lines):
            offset = (index - (len(lines) - 1) / 2) * 15
            self.text(x, y + offset, line, "small" if index else "")

    def gain(self, x, y, text, width=96):
        self.block(x, y, text, width, "gain")

    def limit(self, x, y, text, width=96):
        self.block(x, y, text, width, "limit")

    def sum(self, x, y, **signs):
        self.parts.append(f'<circle class="box" cx="{x}" cy="{y}" r="11"/>')
        self.text(x, y, "Σ")
        places = {"left": (-18, -9), "top": (10, -18), "bottom": (10, 19)}
        for side, sign in signs.items():
            self.text(x + places[side][0], y + places[side][1], sign)

    def wire(self, *points, label="", tip=True, above=9):
        path = " ".join(f"{'L' if index else 'M'}{x} {y}" for index, (x, y) in enumerate(points))
        self.parts.append(f'<path class="wire" d="{path}"{" marker-end=" + chr(34) + "url(#tip)" + chr(34) if tip else ""}/>')
        if label:
            (x0, y0), (x1, y1) = points[0], points[1]
            self.text((x0 + x1) / 2, (y0 + y1) / 2 - above, label, "small")

    def dot(self, x, y):
        self.parts.append(f'<circle cx="{x}" cy="{y}" r="2.5"/>')

    def save(self):
        with open(os.path.join(PICTURES, f"{self.name}.svg"), "w", encoding="utf-8") as file:
            file.write("\n".join([*self.parts, "</svg>", ""]))


def gains(name):
    with open(os.path.join(ROOT, "controllers/gains", f"{name}.toml"), "rb") as file:
        return tomllib.load(file)


def said(number):
    """A number of a gains file with its unit."""
    unit = number["unit"].replace("^2", "²").replace("^3", "³").replace("deg", "°").replace(" 1", "")
    return f"{number['value']:g}" if unit == "1" else f"{number['value']:g} {unit}"


def pid_angle(drawing, y, axis, letter, rate, limits, of):
    """Figs 3.2 to 3.4: one of the three angle loops of `pid`, its middle line at y."""
    drawing.text(12, y - 62, f"{axis.capitalize()}", "head")
    drawing.text(12, y, f"{letter} asked", "start")
    if limits:
        drawing.limit(130, y, f"cut to ±{of['attitude']['command_max']['value']:g}°", 84)
        drawing.wire((72, y), (88, y))
        drawing.wire((172, y), (209, y))
    else:
        drawing.wire((72, y), (209, y))
    drawing.sum(220, y, left="+", bottom="−")
    drawing.text(220, y + 52, f"{letter} estimated")
    drawing.wire((220, y + 43), (220, y + 11))
    drawing.text(249, y - 10, "e", "small")
    drawing.wire((231, y), (300, y))
    drawing.dot(265, y)
    drawing.gain(360, y, f"Kp\n{said(of[axis]['proportional'])}", 120)
    drawing.wire((265, y), (265, y - 48), (300, y - 48))
    most = of["attitude"]["integral_max"]
    drawing.gain(360, y - 48, f"Ki ∫ e dt\n{said(of[axis]['integral'])}", 120)
    drawing.wire((420, y - 48), (446, y - 48))
    drawing.limit(500, y - 48, f"within ±{said(most)}", 108)
    drawing.text(130, y + 52, f"body rate {rate}", "end")
    drawing.wire((136, y + 52), (150, y + 52), (150, y + 74), (279, y + 74), (279, y + 52), (300, y + 52))
    drawing.gain(360, y + 52, f"Kd\n{said(of[axis]['derivative'])}", 120)
    drawing.sum(600, y, left="+", top="+", bottom="−")
    drawing.wire((420, y), (589, y))
    drawing.wire((554, y - 48), (600, y - 48), (600, y - 11))
    drawing.wire((420, y + 52), (600, y + 52), (600, y + 11))
    drawing.wire((611, y), (690, y), label="rad/s²")
    drawing.block(740, y, f"× J about {'xyz'['pqr'.index(rate)]}", 100)
    drawing.wire((790, y), (850, y))
    drawing.text(856, y, "torque", "start")


def draw_pid_angles():
    of = gains("pid")
    drawing = Drawing("pid-angles", "The roll, pitch and yaw loops of the controller pid", 920, 515)
    for y, row in ((85, ("roll", "φ", "p", True)), (255, ("pitch", "θ", "q", True)), (425, ("yaw", "ψ", "r", False))):
        pid_angle(drawing, y, *row, of)
    drawing.save()


def draw_altitude():
    of = gains("pid")["altitude"]
    drawing = Drawing("pid-altitude", "The altitude loop of the controllers pid and cascade", 1080, 235)
    y = 110
    drawing.text(10, y, "z asked", "start")
    drawing.wire((62, y), (109, y))
    drawing.sum(120, y, left="+", bottom="−")
    drawing.text(120, y + 54, "z estimated")
    drawing.wire((120, y + 45), (120, y + 11))
    drawing.wire((131, y), (200, y))
    drawing.text(150, y - 10, "e", "small")
    drawing.dot(166, y)
    drawing.gain(260, y, f"Kp\n{said(of['proportional'])}", 120)
    drawing.wire((166, y), (166, y - 54), (200, y - 54))
    drawing.gain(260, y - 54, f"Ki ∫ e dt\n{said(of['integral'])}", 120)
    drawing.wire((320, y - 54), (345, y - 54))
    drawing.limit(400, y - 54, f"within ±{said(of['integral_max'])}", 110)
    drawing.text(330, y - 88, f"rests while |climb| > {said(of['integral_climb_max'])}, and where the thrust is at a limit and e leads further into it", "small")
    drawing.text(20, y + 96, "rate of climb", "start")
    drawing.wire((110, y + 96), (180, y + 96), (180, y + 54), (200, y + 54))
    drawing.gain(260, y + 54, f"Kd\n{said(of['derivative'])}", 120)
    drawing.sum(500, y, left="+", top="+", bottom="−")
    drawing.wire((320, y), (489, y))
    drawing.wire((455, y - 54), (500, y - 54), (500, y - 11))
    drawing.wire((320, y + 54), (500, y + 54), (500, y + 11))
    drawing.wire((511, y), (579, y), label="m/s²")
    drawing.sum(590, y, left="+", bottom="+")
    drawing.text(590, y + 54, "g")
    drawing.text(590, y + 72, "gravity offset", "small")
    drawing.wire((590, y + 45), (590, y + 11))
    drawing.wire((601, y), (640, y))
    drawing.block(675, y, "× m", 70)
    drawing.wire((710, y), (735, y))
    drawing.block(800, y, "÷ cos φ cos θ\nnot below 0.5", 130)
    drawing.text(800, y + 54, "φ, θ estimated")
    drawing.wire((800, y + 45), (800, y + 18))
    drawing.wire((865, y), (890, y))
    drawing.limit(950, y, "what four rotors\ngive, least to most", 120)
    drawing.wire((1010, y), (1030, y))
    drawing.text(1034, y, "thrust", "start")
    drawing.save()


def draw_cascade():
    of = gains("cascade")
    filtered = of["command_filter"]
    drawing = Drawing("cascade", "The controller cascade", 1090, 270)
    drawing.text(10, 70, "φ, θ asked", "start")
    drawing.wire((84, 70), (110, 70))
    drawing.block(215, 70, f"command filter, cut to ±{filtered['tilt_max']['value']:g}°\nω {said(filtered['natural_frequency'])}, ζ {said(filtered['damping_ratio'])}", 210, height=44)
    drawing.text(10, 125, "ψ asked", "start")
    drawing.wire((66, 125), (110, 125))
    drawing.limit(215, 125, f"turns at most {said(filtered['yaw_rate_max'])}", 210)
    drawing.text(215, 152, "starts at ψ estimated while no thrust is asked for", "small")
    drawing.block(470, 97, "attitude loop\nFig 5.19", 120, height=60)
    drawing.wire((320, 70), (365, 70), (365, 84), (410, 84))
    drawing.wire((320, 125), (365, 125), (365, 110), (410, 110))
    drawing.block(680, 97, "rate loop\nFig 5.18", 120, height=60)
    drawing.wire((530, 97), (620, 97), label="p, q, r asked")
    drawing.block(910, 130, "control allocation\nto the speeds of four rotors", 180, height=92)
    drawing.wire((740, 97), (820, 97), label="torque")
    drawing.text(10, 225, "z asked", "start")
    drawing.wire((64, 225), (620, 225))
    drawing.block(680, 225, "altitude loop\nas in pid", 120, height=44)
    drawing.wire((740, 225), (780, 225), (780, 162), (820, 162))
    drawing.text(790, 200, "thrust", "small start")
    drawing.wire((1000, 130), (1030, 130))
    drawing.text(1035, 122, "counts", "start small")
    drawing.text(1035, 138, "1…200", "start small")
    for x, text in ((470, "φ, θ, ψ estimated"), (680, "p, q, r measured")):
        drawing.text(x, 172, text, "small")
        drawing.wire((x, 162), (x, 127))
    drawing.text(680, 262, "z, rate of climb, φ, θ estimated", "small")
    drawing.wire((680, 255), (680, 247))
    drawing.save()


def draw_attitude_loop():
    of = gains("cascade")["attitude"]
    drawing = Drawing("attitude-loop", "The attitude loop of the controller cascade, one of three axes", 960, 190)
    y = 70
    drawing.text(10, y, "angle, filtered", "start")
    drawing.wire((106, y), (149, y))
    drawing.sum(160, y, left="+", bottom="−")
    drawing.text(160, y + 54, "angle estimated")
    drawing.wire((160, y + 45), (160, y + 11))
    drawing.wire((171, y), (220, y), label="e")
    drawing.gain(290, y, f"roll, pitch {said(of['roll'])}\nyaw {said(of['yaw'])}", 140)
    drawing.sum(420, y, left="+", bottom="+")
    drawing.wire((360, y), (409, y))
    drawing.text(10, 165, "rate of the filtered angle", "start")
    drawing.wire((178, 165), (220, 165))
    drawing.gain(290, 165, f"roll, pitch {said(of['rate_feed_forward'])}\nyaw 0", 140)
    drawing.wire((360, 165), (420, 165), (420, y + 11))
    drawing.wire((431, y), (465, y))
    drawing.limit(545, y, f"±{said(of['roll_pitch_rate_max'])}, yaw ±{said(of['yaw_rate_max'])}", 160)
    drawing.wire((625, y), (665, y))
    drawing.block(745, y, "to body rates, z-y-x\ninverse of eq. 3.18", 160, height=42)
    drawing.text(745, y + 54, "φ, θ estimated")
    drawing.wire((745, y + 45), (745, y + 21))
    drawing.wire((825, y), (860, y))
    drawing.text(864, y, "p, q, r asked", "start")
    drawing.save()


def draw_rate_loop():
    of = gains("cascade")["rate"]
    drawing = Drawing("rate-loop", "The rate loop of the controller cascade, one of three axes", 920, 235)
    y = 100

    def both(key):
        return f"roll, pitch {said(of['roll'][key])}, yaw {said(of['yaw'][key])}"

    drawing.text(10, y, "p, q, r asked", "start")
    drawing.wire((100, y), (139, y))
    drawing.sum(150, y, left="+", bottom="−")
    drawing.wire((161, y), (220, y), label="e")
    drawing.dot(200, y)
    drawing.gain(315, y, f"Kp\n{both('proportional')}", 190)
    drawing.wire((200, y), (200, y - 54), (220, y - 54))
    drawing.gain(315, y - 54, f"Ki ∫ e dt\n{both('integral')}", 190)
    drawing.wire((410, y - 54), (440, y - 54))
    drawing.limit(505, y - 54, f"within ±{said(of['integral_max'])}", 130)
    drawing.text(10, y + 80, "p, q, r measured", "start")
    drawing.wire((126, y + 80), (150, y + 80), (150, y + 11))
    drawing.dot(150, y + 80)
    drawing.wire((150, y + 80), (220, y + 80))
    drawing.block(315, y + 80, f"rate of change\nbehind a lag of {said(of['derivative_filter'])}", 190)
    drawing.wire((410, y + 80), (440, y + 80))
    drawing.gain(525, y + 80, f"Kd\n{both('derivative')}", 170)
    drawing.sum(650, y, left="+", top="+", bottom="−")
    drawing.wire((410, y), (639, y))
    drawing.wire((570, y - 54), (650, y - 54), (650, y - 11))
    drawing.wire((610, y + 80), (650, y + 80), (650, y + 11))
    drawing.wire((661, y), (715, y), label="rad/s²")
    drawing.block(760, y, "× J", 90)
    drawing.wire((805, y), (850, y))
    drawing.text(855, y, "torque", "start")
    drawing.save()


def draw_velocity():
    of = gains("velocity")["velocity"]
    drawing = Drawing("velocity-loop", "The velocity loops around the cascade", 1080, 230)
    y = 100
    drawing.text(10, y, "u or v asked", "start")
    drawing.wire((94, y), (129, y))
    drawing.sum(140, y, left="+", bottom="−")
    drawing.wire((151, y), (205, y), label="e")
    drawing.gain(265, y, f"Kp\n{said(of['proportional'])}", 120)
    drawing.text(10, y + 80, "u or v estimated", "start")
    drawing.wire((122, y + 80), (140, y + 80), (140, y + 11))
    drawing.dot(140, y + 80)
    drawing.wire((140, y + 80), (190, y + 80))
    drawing.block(265, y + 80, f"rate of change\nbehind a lag of {said(of['derivative_filter'])}", 150)
    drawing.wire((340, y + 80), (365, y + 80))
    drawing.gain(415, y + 80, f"Kd\n{said(of['derivative'])}", 100)
    drawing.sum(510, y, left="+", top="+", bottom="−")
    drawing.wire((325, y), (499, y))
    drawing.wire((465, y + 80), (510, y + 80), (510, y + 11))
    drawing.text(500, 20, "of a guidance: feed-forward and integral over the distance, 0 without", "small")
    drawing.wire((510, 30), (510, y - 11))
    drawing.wire((521, y), (555, y))
    drawing.limit(620, y, f"within ±{said(of['acceleration_max'])}", 130)
    drawing.wire((685, y), (720, y))
    drawing.block(815, y, "ahead: θ = atan(a / g)\nleft: φ = −atan(a cos θ / g)", 190, height=42)
    drawing.wire((910, y), (950, y), label="φ, θ")
    drawing.block(1005, y, "cascade", 110)
    drawing.save()


def draw_states():
    stop, follow = gains("wall-stop"), gains("wall-follow")
    drawing = Drawing("wall-states", "What the guidance before walls asks the velocity loops for", 1080, 480)

    def line(y, head, source, curve, out, extra=""):
        drawing.text(10, y - 42, head, "head")
        drawing.text(10, y, source, "start")
        drawing.wire((200, y), (249, y))
        drawing.sum(260, y, left="+", bottom="−")
        drawing.text(260, y + 40, "3 m")
        drawing.wire((260, y + 31), (260, y + 11))
        drawing.wire((271, y), (330, y), label="to go")
        drawing.gain(485, y, curve, 310)
        drawing.wire((640, y), (680, y))
        drawing.limit(775, y, out, 190)
        drawing.wire((870, y), (900, y))
        drawing.text(905, y, extra, "start")

    near = stop["approach"]
    line(60, "wall-stop: ahead (§5.5)", "distance to the wall ahead", f"v = k e, further off √(2 a (e − a/2k²))\nk {said(near['slope'])}, a {said(near['deceleration'])}", "at most the cruising speed,\n0.8 m/s² to gather it".replace("0.8 m/s²", said(gains("velocity")["velocity"]["command_acceleration_max"])), "u asked")
    hold = stop["hold"]
    drawing.text(330, 112, f"Its acceleration −v dv/de is fed forward; holding, an integral of {said(hold['integral'])} over the error, within ±{said(hold['integral_max'])}, is added.", "small start")
    drawing.text(330, 129, f"Along the wall it asks for v = −{said(hold['aside'])} times what it has slid, at most {said(near['retreat_max'])}.", "small start")
    varying = follow["varying"]
    line(190, "wall-follow, varying: each state's own direction (Figs 5.37, 5.38)", "distance to the wall ahead", f"v = k e, not below {said(varying['exit_speed'])}\nk {said(varying['slope'])}", "at most 1.5 m/s", "ahead; across = 0")
    constant = follow["constant"]
    line(320, "wall-follow, constant: beside the wall (Figs 5.46, 5.47)", "distance to the wall beside", f"v = k e, further off √(2 a (e − a/2k²))\nk {said(constant['slope'])}, a {said(constant['deceleration'])}", "at most the speed,\n0.7 m/s", "across")
    drawing.wire((885, 320), (885, 390), (690, 390))
    drawing.dot(885, 320)
    drawing.block(560, 390, "ahead = √(speed² − across²)", 260)
    drawing.wire((430, 390), (390, 390))
    drawing.text(384, 390, "ahead", "end")
    drawing.text(10, 430, f"An integral of {said(constant['integral'])} over the error beside, within ±{said(constant['integral_max'])}, is added to the acceleration across. Next state (1, 2, 3, 4, 5, 2, …): varying, where the wall", "small start")
    drawing.text(10, 450, "ahead is at 3 m; constant, where the curve's velocity towards the wall ahead is the speed itself, so that the command turns without a jump.", "small start")
    drawing.save()


def main():
    os.makedirs(PICTURES, exist_ok=True)
    for draw in (draw_pid_angles, draw_altitude, draw_cascade, draw_attitude_loop, draw_rate_loop, draw_velocity, draw_states):
        draw()


main()
