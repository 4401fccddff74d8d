"""Streams that meshoptimizer's own encoder made (meshopt 0.1.1 of PyPI), and what they hold."""

import numpy as np


def grid(n: int) -> np.ndarray:
    """Corners of the triangles of n x n vertices, row by row."""
    v = np.arange(n * n).reshape(n, n)
    a, b, c, d = v[:-1, :-1], v[:-1, 1:], v[1:, :-1], v[1:, 1:]
    return np.stack([a, b, c, b, d, c], axis=-1).reshape(-1).astype(np.uint32)


def directions(n: int) -> np.ndarray:
    """(n, 3) unit vectors on a spiral from pole to pole, float32."""
    y, turn = np.linspace(-1.0, 1.0, n), np.arange(n) * 2.4
    r = np.sqrt(1.0 - y * y)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1).astype(np.float32)


def rotations(n: int) -> np.ndarray:
    """(n, 4) unit quaternions whose greatest component, each of the four in turn, is positive."""
    q = np.concatenate([directions(n) * 0.6, np.full((n, 1), 0.8)], axis=1)
    return np.stack([np.roll(each, k) for k, each in enumerate(q)]).astype(np.float32)


SCATTERED = (np.arange(60) ** 3 * 7919 % 100_003).astype(np.uint32)
SIGNED = np.concatenate([directions(20), np.resize([1.0, -1.0], (20, 1))], axis=1).astype(np.float32)

# by name the mode, the filter, and the values
PLAIN = {
    "bytes": ("ATTRIBUTES", "NONE", (np.arange(160) ** 2 % 251).astype(np.uint8).reshape(40, 4)),
    "floats": ("ATTRIBUTES", "NONE", (np.arange(60) / 7.0).astype(np.float32).reshape(20, 3)),
    "blocks": ("ATTRIBUTES", "NONE", (np.arange(600) // 5).astype(np.uint32).reshape(600, 1)),
    "single": ("ATTRIBUTES", "NONE", np.full((1, 12), 200, np.uint8)),
    "grid": ("TRIANGLES", "NONE", grid(8)),
    "scattered": ("TRIANGLES", "NONE", SCATTERED),
    "twice": ("TRIANGLES", "NONE", np.concatenate([grid(5), grid(5)])),
    "sequence": ("INDICES", "NONE", np.concatenate([np.arange(40, dtype=np.uint32), SCATTERED[:9]])),
    "directions": ("ATTRIBUTES", "OCTAHEDRAL", SIGNED),
    "directions8": ("ATTRIBUTES", "OCTAHEDRAL", SIGNED),
    "rotations": ("ATTRIBUTES", "QUATERNION", rotations(20)),
    "exponents": ("ATTRIBUTES", "EXPONENTIAL", directions(20) * np.float32(1000.0)),
}

STREAMS = {
    "bytes": (
        "pdSDrV4&*Xl~olgYO3_ri%SbMbiVY#i$MWCh`#=}cQ^n4000O`h|>41Z8skPFmSN?&xJ(=I(o$VyM;RhM2^JqyKylNPL9~|r"
        ")MYs{{R3OSeWAHon0Lt06>7i^}lsB3QCm9^{Z<u6jYSn>!D#G9$ud4;g?qz|Nj60C}^ni*NsgL9{^C0(B-9XB^qR!+S{9D8z"
        "gR|<k68^5jbwH_|b<)2mk&6062KK{k?}h00000000000000000000000000000000000009IE"
    ),
    "floats": (
        "pa%ev0NdP2k&%&+NJmLWNlE_z002ixN0A2r+5k#Pk=)$c+>()zk&%=C0001yk&)a707?InZd^7vHZ~?292^`P{{R3092^=L1"
        "vnr80DJ-f000L707=~1l#`K>kx55MM@dKj0000<Nk`iU005CmN!i-m+}x9qk&%&+{{R30k&}^12LJ%vY;H<6I5s#M92^=P9R"
        "C0S02~?|5(OY200062000L7l9Afnk&%&;+($`CM@dKj0000<M@ifV0NdP2N7~%n+DDO*laY~;{{R30k&%%}2LQLYZf-U<I5s"
        "XE92y)P8vg(Q02~|~3<V&7000O8000000000000000000000000000000001RP5<VqKl0E"
    ),
    "blocks": (
        "pjA~>RRACe0sw#@2m%0rAP52gfFKA00DvF}0sw#@2m%0rAP52gfFKA00DvF}0sw#@2m%0rAP52gfFKA00DvF}0ssI2000000"
        "000009930RRDk>2m%0rAP52gfFKA00DvF}0sw#@2m%0rAP52gfFKA00DvF}0sw#@2m%0rAP52gfFKA00DvF}0sw#@2mk;800"
        "00000000096G70DvF}0sw#@2m%0rAP52gfFKA00000000000000000000000000000000000000000000000000000"
    ),
    "single": ("pa1{>000000000000000000000000000000000000LaM5$jHdZ$jHdZ$N"),
    "grid": (
        ";r<>F4iF9y4iF9y4iFCh9v=@M4<8R74<8R75C0w?4<8R74<8R74<8Tz9v=@M4<8R74<8R75C0w?4<8R74<8R74<8Tz9v=@M4"
        "<8R74<8R75C0w?4<8R74<8R74<8Q?5Z?j~5DgFw5DgFw5DgID4G;|w4G;|w4G;|w4G`ZA5DgFw5DgFw5DgFw5Z?_D4G;|w4G"
        ";|w4G;|w-whBA5DgFw5DgFw5DgID4G;|w4G;|w4G;|w4G;i!hgN5JsfJ~VXqW+M000"
    ),
    "scattered": (
        ";r{>s|NsC0|NsC0|NsC0|NsC0|Nq{5lHvyck%k7lZO)Mj|Haq|=2(E%1pkPi0)fm1?#TlG%&P^M*#WJs2><yqsFMN5+5`W>x"
        "Czmn2->Fv|Iy(A$%F#(z61Z9&H~HU1jdC1|Nra(k@*Af9{=C?0^}3ih6(?JRj<kfr`ZDkl>P*V`32UH0so@r0i*Z>kg5p(?E"
        "L}!w*iI11^@EI1?_?YndAfi?jW0v0*<Kx|Jl<4@|6M8v;zO-7`*8R`Qifq%FzVL$OfDq0CtB~XLzZGWr=8*0cijL"
    ),
    "twice": (
        ";r<>F4iF9y4$dAH4iyd*4$dAF4ipX)4$dAF4ipX)4*mch03HAy0KgCy02Kff0KgCw02BZe0KgCw02BZe01pcPF9HB|hgN5Js"
        "fJ~VXqW+M000"
    ),
    "sequence": ("(EtPl1Ox;G1Ox;G1Ox;G1Ox;G1Ox;G1Ox;G1Ox;G1Ox;G1Ox;G1OcG-0pYt3fVcsh=MALD5|MJg{}IjI3IG5A00"),
    "directions": (
        "pa%fHP=U7g#u#PgausreUt7Nb006KX5(fY`tTExI;j4qHS-<pY@=yN&008j6)@KI*A!!wVLDa9_a-VqzdDhDR0000w!LQ#30"
        "BB#35fxB(niRT|TooIr{{R30hbBHW000UEG&D3cG&D3cGynhq00005CT3=4W&i*H00000000000000000000000000000000"
        "04i|9}5~"
    ),
    "directions8": (
        "pa%dosxjZI-K&MJU%mEi_D}x+008d4*l7m<YF~~K6;OAY61tOI6&t4i0001mCO$L(3IsGXG&D3cG&D2-0000000000000000"
        "000000000000000000000000004o1e*"
    ),
    "rotations": (
        "pa%eW&9uWS8W8~miW;DVrjP#s002Wr1kDEkM^aYsuhlEnZrL04h0Iw00001x{mMfJ0N&o*-rnBa-rn5a-rU~a{{R30-rU~a2"
        "LKir78n*57#0{77#0{77XJVM02me+76$-%Rf?H9S^rz{-rp!2OBeqD001w$GGYe+K*jx=N7aP=3g~UhKFGBH0002#VM#^>I="
        "Z^L1qB5Kx&QzG1poj5000000000000000000000000000000WRm~@|9="
    ),
    "exponents": (
        "pa%dir`4lN32;nB22p09;QRjo006tD#O4P8RXu@Rge|%Hsj?esSwf`$0001!r-IN208?OM$bI!OsWPu0=1ZPr{{R30rrhXF0"
        "0#ir*4WtC*w)zC*x1<C*x3I7007w7*4PICP*74(QczG*P*PA*P*76;0000`QczL{02&$^8X6iL8X6iJ8XOuL{{R308X6iL00"
        "#gVUZKaai2I~d<<hh8n6Uo<003rsM?D7sl|^wonUaCjZoE~S!zVZY0000#s`0c307~Q4vs0%?(+a*ZoJi(?{{R30zim}e000"
        "000000000000000000000000000^8f&Y^8f$<^8"
    ),
}  # base 85
