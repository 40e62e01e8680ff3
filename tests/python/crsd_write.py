"""Writes CRSD 1.0 of points, by formulas of its own, and has sarkit's crsdcheck find each file consistent.

    crsd_write.py FOLDER
    crsd_write.py FOLDER defects

Each file is NAME.crsd, with NAME.txt beside it: a line a point, x y z in the scene frame, metres, and its complex amplitude. Samples are
exact: of every sample's moment the moment is solved for at which what arrives then was sent, with both antennas moving all the time.

With `defects`, the files contain the noise of receivers: noise.crsd without defects, unbalanced.crsd with bias, imbalance and vectors of
zeros, clipped.crsd with clipped values, whose number is in clipped.count.
"""

import pathlib
import sys

import lxml.etree
import numpy as np
import sarkit.crsd as skcrsd
import sarkit.verification as skver
import sarkit.wgs84

np.set_printoptions(legacy="1.25")  # numbers print as numbers
C = 299792458.0
NS = "http://api.nsgreg.nga.mil/schema/crsd/1.0"
POINTS = [
    (0.0, 0.0, 0.0, 1.0, 0.0),
    (21.0, -16.0, 0.0, 0.0, 0.8),
    (-18.0, 24.0, 0.0, -0.42, -0.42),
]


class Case:
    """What is sent and received, and by whom; positions in the scene frame (east, north, up) as functions of time."""

    centre = 9.6e9
    bandwidth = 100e6
    length = 20e-6
    rate_sign = 1.0
    fs = 125e6
    samples = 3072
    pulses = 64
    pri = 8e-3
    offset = 0.0  # of the reference signal's frequency from the pulse's middle
    format = "CF8"
    noise_at = None  # a vector of noise alone, after so many pulses
    received = 1.0  # part of the pulse's band that was received
    step = None  # amplitude of an integer's step, the same in all vectors

    def transmitter(self, t):
        return np.array([100.0, 0.0, 0.0]) * (t[..., None] - 0.25) + np.array([0.0, -4000.0, 3000.0])

    receiver = transmitter


class Plain(Case):
    pass


class Falling(Case):
    """A falling sweep, integers, a reference signal off the middle, a vector of noise; the receiver elsewhere."""

    rate_sign = -1.0
    offset = 4e6
    format = "CI4"
    noise_at = 20
    pulses = 65

    def receiver(self, t):
        return np.array([60.0, 30.0, 0.0]) * (t[..., None] - 0.2) + np.array([900.0, -3500.0, 2600.0])


class Spaceborne(Case):
    """From 600 km, looking ahead, so that the path changes by 1.5 km/s; bytes; the receiver took part of the band."""

    length = 40e-6
    samples = 6144
    pri = 12e-3
    format = "CI2"
    received = 0.8

    def transmitter(self, t):
        return np.array([7500.0, 0.0, 0.0]) * (t[..., None] - 0.4) + np.array([-60e3, -350e3, 480e3])

    receiver = transmitter


class Noise(Case):
    """Gaussian noise of a receiver in place of the echoes, 3000 steps in I and in Q; a vector of noise alone."""

    format = "CI4"
    noise_at = 5
    step = 1 / 3000
    pulses = 48

    def signal(self, draw):
        return draw.normal(size=(self.pulses, self.samples, 2)).view(complex)[..., 0]


class Unbalanced(Noise):
    """Q has a gain of 1.12 and a phase error of 5 degrees; bias; pulses of zeros."""

    def signal(self, draw):
        z = super().signal(draw)
        error = np.radians(5.0)
        q = 1.12 * (z.imag * np.cos(error) + z.real * np.sin(error))
        z = z.real + 0.3 + 1j * (q - 0.2)
        z[[10, 11, 40]] = 0
        return z


class Clipped(Noise):
    """Limited at 32767 / 12000 = 2.7 standard deviations."""

    step = 1 / 12000


def velocity(track, t):
    return track(t + 0.5) - track(t - 0.5)  # both are straight


def echoes(case, sent, starts, phases, references):
    """Samples of each vector: `sent` when the middle of its pulse left."""
    rate = case.rate_sign * case.bandwidth / case.length
    out = np.zeros((len(sent), case.samples), complex)
    for n, (middle, start) in enumerate(zip(sent, starts)):
        after = np.arange(case.samples) / case.fs
        since = (start - middle) + after  # from the pulse's middle
        for x, y, z, re, im in POINTS:
            point = np.array([x, y, z])
            back = np.linalg.norm(case.receiver(middle + since) - point, axis=-1)
            left = since - 2.0 * back / C
            for _ in range(6):
                forth = np.linalg.norm(case.transmitter(middle + left) - point, axis=-1)
                left = since - (forth + back) / C
            turns = phases[n] + case.centre * left + 0.5 * rate * left**2 - references[n] - (case.centre + case.offset) * after
            echo = np.exp(2j * np.pi * (turns - np.round(turns)))
            out[n] += (re + 1j * im) * np.where(np.abs(left) <= case.length / 2, echo, 0)
    return out


def fractions(dtype, values):
    """Numbers as whole part and fraction."""
    out = np.zeros(len(values), dtype)
    out["Int"] = np.floor(values).astype(int)
    out["Frac"] = values - np.floor(values)
    return out


def xyz(name, v):
    return f"<{name}><X>{v[0]!r}</X><Y>{v[1]!r}</Y><Z>{v[2]!r}</Z></{name}>"


def parameters(kind, fields):
    words = {"F8": 1, "I8": 1, "X=F8;Y=F8;Z=F8;": 3, "Int=I8;Frac=F8;": 2, "DCX=F8;DCY=F8;": 2}
    text, offset = "", 0
    for name, form in fields:
        text += f"<{name}><Offset>{offset}</Offset><Size>{words[form]}</Size><Format>{form}</Format></{name}>"
        offset += words[form]
    return f"<{kind}>{text}</{kind}>", 8 * offset


F8, I8, XYZ, PAIR, EB = "F8", "I8", "X=F8;Y=F8;Z=F8;", "Int=I8;Frac=F8;", "DCX=F8;DCY=F8;"
PPP = [
    ("TxTime", PAIR), ("TxPos", XYZ), ("TxVel", XYZ), ("FX1", F8), ("FX2", F8), ("TXmt", F8), ("PhiX0", PAIR), ("FxFreq0", F8),
    ("FxRate", F8), ("TxRadInt", F8), ("TxACX", XYZ), ("TxACY", XYZ), ("TxEB", EB), ("FxResponseIndex", I8),
]  # fmt: skip
PVP = [
    ("RcvStart", PAIR), ("RcvPos", XYZ), ("RcvVel", XYZ), ("FRCV1", F8), ("FRCV2", F8), ("RefPhi0", PAIR), ("RefFreq", F8),
    ("DFIC0", F8), ("FICRate", F8), ("RcvACX", XYZ), ("RcvACY", XYZ), ("RcvEB", EB), ("SIGNAL", I8), ("AmpSF", F8), ("DGRGC", F8),
    ("TxPulseIndex", I8),
]  # fmt: skip


def write(path, case, seed):
    draw = np.random.default_rng(seed)
    place = np.array([47.3, 8.5, 420.0])
    origin = sarkit.wgs84.geodetic_to_cartesian(place)
    east, north, up = (
        f(place) for f in (sarkit.wgs84.east, sarkit.wgs84.north, sarkit.wgs84.up)
    )
    turn = np.stack([east, north, up])
    ecf = lambda p: origin + p @ turn
    along = lambda v: v @ turn

    # On the clock of samples, and so that the echo of the middle of the scene lies in the middle of the window.
    count = case.pulses
    sent = 3.0 + np.arange(count) * case.pri - (case.pri * count / 2) + 0.4
    sent = np.round(sent * case.fs) / case.fs + 0.37e-8  # not on the receiver's
    zero = np.zeros(3)
    delay = np.array([
        (np.linalg.norm(case.transmitter(np.array(t)) - zero) + np.linalg.norm(case.receiver(np.array(t)) - zero)) / C for t in sent
    ])  # fmt: skip
    grid = np.floor((sent + delay - 0.5 * case.samples / case.fs) * case.fs)
    starts = grid / case.fs
    phases = draw.uniform(-40.0, 40.0, count)
    references = draw.uniform(-40.0, 40.0, count)
    signal = echoes(case, sent, starts, phases, references) if case.step is None else case.signal(draw)

    index = np.arange(count)
    kinds = np.ones(count, int)
    if case.noise_at is not None:
        # A window between two pulses.
        at = case.noise_at
        extra = np.floor((starts[at] + 0.5 * case.pri) * case.fs) / case.fs
        noise = draw.normal(size=(1, case.samples, 2)).view(complex)[..., 0]
        starts = np.insert(starts, at + 1, extra)
        references = np.insert(references, at + 1, 0.25)
        signal = np.insert(signal, at + 1, noise, axis=0)
        index, kinds = np.insert(index, at + 1, -1), np.insert(kinds, at + 1, 2)
    vectors = len(starts)
    scale = np.full(vectors, case.step or 1.0)
    full = {"CF8": None, "CI4": 30000, "CI2": 127}[case.format]
    if full is None:
        stored = signal.astype(np.complex64)
    else:
        if case.step is None:
            # To the largest of each vector.
            scale = np.abs(signal.view(float)).max(axis=1) / full
        parts = np.round(signal.view(float) / scale[:, None])
        if case.step is not None:
            over = (parts >= 32767) | (parts <= -32768)
            path.with_suffix(".count").write_text(f"{over[kinds == 1].sum()}\n")
            parts = np.clip(parts, -32768, 32767)
        kind = np.dtype([("real", "i2"), ("imag", "i2")] if case.format == "CI4" else [("real", "i1"), ("imag", "i1")])
        stored = np.zeros(signal.shape, kind)
        stored["real"], stored["imag"] = parts[:, ::2], parts[:, 1::2]

    f1, f2 = case.centre - case.bandwidth / 2, case.centre + case.bandwidth / 2
    half = 0.5 * case.bandwidth * case.received
    r1, r2 = case.centre - half, case.centre + half
    ppp_xml, ppp_bytes = parameters("PPP", PPP)
    pvp_xml, pvp_bytes = parameters("PVP", PVP)
    area = (
        "<X1Y1><X>-50.0</X><Y>-50.0</Y></X1Y1><X2Y2><X>50.0</X><Y>50.0</Y></X2Y2><Polygon size='4'>"
        + "".join(
            f"<Vertex index='{i + 1}'><X>{x}</X><Y>{y}</Y></Vertex>"
            for i, (x, y) in enumerate([(-50.0, -50.0), (-50.0, 50.0), (50.0, 50.0), (50.0, -50.0)])
        )
        + "</Polygon>"
    )
    corners = [sarkit.wgs84.cartesian_to_geodetic(ecf(np.array([x, y, 0.0]))) for x, y in [(-50, -50), (-50, 50), (50, 50), (50, -50)]]
    corners = "".join(f"<IACP index='{i + 1}'><Lat>{c[0]!r}</Lat><Lon>{c[1]!r}</Lon></IACP>" for i, c in enumerate(corners))
    refpoint = f"{xyz('ECF', origin)}<IAC><X>0.0</X><Y>0.0</Y></IAC>"
    acx, acy = along(np.array([1.0, 0.0, 0.0])), along(np.array([0.0, 1.0, 0.0]))
    tx_pos = ecf(np.stack([case.transmitter(np.array(t)) for t in sent]))
    rcv_pos = ecf(np.stack([case.receiver(np.array(t)) for t in starts]))
    ref = count // 2
    ref_vector = int(np.flatnonzero(index == ref)[0])

    def polarization(name, position, direction):
        h, v, ph, pv = skcrsd.compute_h_v_pol_parameters(position, acx, acy, origin, direction, 1.0, 0.0, 0.0, 0.0)
        return (
            f"<{name}><PolarizationID>X</PolarizationID><AmpH>{float(h)!r}</AmpH><AmpV>{float(v)!r}</AmpV>"
            f"<PhaseH>{float(ph)!r}</PhaseH><PhaseV>{float(pv)!r}</PhaseV></{name}>"
        )

    gain = "<ElementFormat>Gain=F4;Phase=F4;</ElementFormat><X0>-1.0</X0><Y0>-1.0</Y0><XSS>1.0</XSS><YSS>1.0</YSS>"
    sensor = "<SensorName>script</SensorName><EventName>points</EventName>"
    bistatic = type(case).receiver is not type(case).transmitter
    times = f"<TxTime1>{sent[0]!r}</TxTime1><TxTime2>{sent[-1]!r}</TxTime2>"
    window = f"<RcvStartTime1>{starts[0]!r}</RcvStartTime1><RcvStartTime2>{starts[-1]!r}</RcvStartTime2>"
    band = f"<FrcvMin>{r1!r}</FrcvMin><FrcvMax>{r2!r}</FrcvMax>"
    xml = f"""<CRSDsar xmlns="{NS}">
<ProductInfo><ProductName>{path.stem}</ProductName><Classification>UNCLASSIFIED</Classification><ReleaseInfo>UNRESTRICTED</ReleaseInfo></ProductInfo>
<SARInfo><CollectType>{"BISTATIC" if bistatic else "MONOSTATIC"}</CollectType><RadarMode><ModeType>SPOTLIGHT</ModeType></RadarMode></SARInfo>
<TransmitInfo>{sensor}</TransmitInfo><ReceiveInfo>{sensor}</ReceiveInfo>
<Global><CollectionRefTime>2026-01-02T03:04:05.000000Z</CollectionRefTime>
<Transmit>{times}<FxMin>{f1!r}</FxMin><FxMax>{f2!r}</FxMax></Transmit><Receive>{window}{band}</Receive></Global>
<SceneCoordinates><EarthModel>WGS_84</EarthModel><IARP>{xyz("ECF", origin)}
<LLH><Lat>{place[0]}</Lat><Lon>{place[1]}</Lon><HAE>{place[2]}</HAE></LLH></IARP>
<ReferenceSurface><Planar>{xyz("uIAX", east)}{xyz("uIAY", north)}</Planar></ReferenceSurface>
<ImageArea>{area}</ImageArea><ImageAreaCornerPoints>{corners}</ImageAreaCornerPoints></SceneCoordinates>
<Data><Support><NumSupportArrays>2</NumSupportArrays>
<SupportArray><SAId>GP</SAId><NumRows>3</NumRows><NumCols>3</NumCols><BytesPerElement>8</BytesPerElement><ArrayByteOffset>0</ArrayByteOffset></SupportArray>
<SupportArray><SAId>FX</SAId><NumRows>1</NumRows><NumCols>3</NumCols><BytesPerElement>8</BytesPerElement><ArrayByteOffset>72</ArrayByteOffset></SupportArray></Support>
<Transmit><NumBytesPPP>{ppp_bytes}</NumBytesPPP><NumTxSequences>1</NumTxSequences>
<TxSequence><TxId>T</TxId><NumPulses>{count}</NumPulses><PPPArrayByteOffset>0</PPPArrayByteOffset></TxSequence></Transmit>
<Receive><SignalArrayFormat>{case.format}</SignalArrayFormat><NumBytesPVP>{pvp_bytes}</NumBytesPVP><NumCRSDChannels>1</NumCRSDChannels>
<Channel><ChId>R</ChId><NumVectors>{vectors}</NumVectors><NumSamples>{case.samples}</NumSamples><SignalArrayByteOffset>0</SignalArrayByteOffset>
<PVPArrayByteOffset>0</PVPArrayByteOffset></Channel></Receive></Data>
<TxSequence><RefTxId>T</RefTxId><TxWFType>LFM</TxWFType><Parameters><Identifier>T</Identifier><RefPulseIndex>{ref}</RefPulseIndex>
<FxResponseId>FX</FxResponseId><FxBWFixed>true</FxBWFixed><FxC>{case.centre!r}</FxC><FxBW>{case.bandwidth!r}</FxBW>
<TXmtMin>{case.length!r}</TXmtMin><TXmtMax>{case.length!r}</TXmtMax>{times}<TxAPCId>A</TxAPCId><TxAPATId>P</TxAPATId>
<TxRefPoint>{refpoint}</TxRefPoint>{polarization("TxPolarization", tx_pos[ref], 1)}<TxRefRadIntensity>1.0</TxRefRadIntensity>
<TxRadIntErrorStdDev>0.0</TxRadIntErrorStdDev><TxRefLAtm>0.0</TxRefLAtm></Parameters></TxSequence>
<Channel><RefChId>R</RefChId><Parameters><Identifier>R</Identifier><RefVectorIndex>{ref_vector}</RefVectorIndex><RefFreqFixed>true</RefFreqFixed>
<FrcvFixed>true</FrcvFixed><SignalNormal>{"true" if case.noise_at is None else "false"}</SignalNormal><F0Ref>{case.centre + case.offset!r}</F0Ref>
<Fs>{case.fs!r}</Fs><BWInst>{2 * half!r}</BWInst>{window}{band}<RcvAPCId>A</RcvAPCId><RcvAPATId>P</RcvAPATId>
<RcvRefPoint>{refpoint}</RcvRefPoint>{polarization("RcvPolarization", rcv_pos[ref_vector], -1)}<RcvRefIrradiance>1.0</RcvRefIrradiance>
<RcvIrradianceErrorStdDev>0.0</RcvIrradianceErrorStdDev><RcvRefLAtm>0.0</RcvRefLAtm><PNCRSD>0.0</PNCRSD><BNCRSD>1.0</BNCRSD>
<SARImage><TxId>T</TxId><RefVectorPulseIndex>{ref}</RefVectorPulseIndex>{polarization("TxPolarization", tx_pos[ref], 1)}
<DwellTimes><Polynomials><CODId>C</CODId><DwellId>D</DwellId></Polynomials></DwellTimes><ImageArea>{area}</ImageArea></SARImage></Parameters></Channel>
<ReferenceGeometry/>
<DwellPolynomials><NumCODTimes>1</NumCODTimes><CODTime><Identifier>C</Identifier><CODTimePoly order1="0" order2="0">
<Coef exponent1="0" exponent2="0">{(sent[0] + sent[-1]) / 2!r}</Coef></CODTimePoly></CODTime><NumDwellTimes>1</NumDwellTimes>
<DwellTime><Identifier>D</Identifier><DwellTimePoly order1="0" order2="0"><Coef exponent1="0" exponent2="0">{sent[-1] - sent[0]!r}</Coef></DwellTimePoly>
</DwellTime></DwellPolynomials>
<SupportArray><GainPhaseArray><Identifier>GP</Identifier>{gain}</GainPhaseArray>
<FxResponseArray><Identifier>FX</Identifier><ElementFormat>Amp=F4;Phase=F4;</ElementFormat><Fx0FXR>{f1!r}</Fx0FXR><FxSSFXR>{case.bandwidth / 2!r}</FxSSFXR>
</FxResponseArray></SupportArray>{ppp_xml}{pvp_xml}
<Antenna><NumACFs>1</NumACFs><NumAPCs>1</NumAPCs><NumAPATs>1</NumAPATs><AntCoordFrame><Identifier>F</Identifier></AntCoordFrame>
<AntPhaseCenter><Identifier>A</Identifier><ACFId>F</ACFId>{xyz("APCXYZ", np.zeros(3))}</AntPhaseCenter>
<AntPattern><Identifier>P</Identifier><FreqZero>{case.centre!r}</FreqZero><ArrayGPId>GP</ArrayGPId><ElemGPId>GP</ElemGPId>
<EBFreqShift><DCXSF>0.0</DCXSF><DCYSF>0.0</DCYSF></EBFreqShift><MLFreqDilation><DCXSF>0.0</DCXSF><DCYSF>0.0</DCYSF></MLFreqDilation>
<GainBSPoly order1="0"><Coef exponent1="0">0.0</Coef></GainBSPoly>
<AntPolRef><AmpX>1.0</AmpX><AmpY>0.0</AmpY><PhaseX>0.0</PhaseX><PhaseY>0.0</PhaseY></AntPolRef></AntPattern></Antenna>
</CRSDsar>"""
    tree = lxml.etree.ElementTree(lxml.etree.fromstring(xml))

    ppp = np.zeros(count, skcrsd.get_ppp_dtype(tree))
    ppp["TxTime"], ppp["PhiX0"] = fractions(ppp["TxTime"].dtype, sent), fractions(ppp["PhiX0"].dtype, phases)
    ppp["TxPos"], ppp["TxVel"] = tx_pos, along(np.stack([velocity(case.transmitter, np.array(t)) for t in sent]))
    ppp["FX1"], ppp["FX2"], ppp["TXmt"], ppp["FxFreq0"] = f1, f2, case.length, case.centre
    ppp["FxRate"], ppp["TxRadInt"] = case.rate_sign * case.bandwidth / case.length, 1.0
    ppp["TxACX"], ppp["TxACY"] = acx, acy
    pvp = np.zeros(vectors, skcrsd.get_pvp_dtype(tree))
    pvp["RcvStart"], pvp["RefPhi0"] = fractions(pvp["RcvStart"].dtype, starts), fractions(pvp["RefPhi0"].dtype, references)
    pvp["RcvPos"], pvp["RcvVel"] = rcv_pos, along(np.stack([velocity(case.receiver, np.array(t)) for t in starts]))
    pvp["FRCV1"], pvp["FRCV2"], pvp["RefFreq"] = r1, r2, case.centre + case.offset
    pvp["RcvACX"], pvp["RcvACY"], pvp["SIGNAL"], pvp["AmpSF"], pvp["TxPulseIndex"] = acx, acy, kinds, scale, index
    geometry = skcrsd.compute_reference_geometry(tree, pvps=pvp, ppps=ppp)
    old = tree.find("{*}ReferenceGeometry")
    old.getparent().replace(old, geometry)

    response = np.zeros((1, 3), [("Amp", "f4"), ("Phase", "f4")])
    response["Amp"] = 1.0
    with path.open("wb") as file, skcrsd.Writer(file, skcrsd.Metadata(xmltree=tree)) as out:
        out.write_signal("R", stored)
        out.write_pvp("R", pvp)
        out.write_ppp("T", ppp)
        out.write_support_array("GP", np.zeros((3, 3), [("Gain", "f4"), ("Phase", "f4")]))
        out.write_support_array("FX", response)
    path.with_suffix(".txt").write_text("".join(" ".join(map(repr, p)) + "\n" for p in POINTS))
    with path.open("rb") as file:
        check = skver.CrsdConsistency.from_file(file, thorough=True)
        check.check()
    failed = list(check.failures()) + list(check.warnings() if hasattr(check, "warnings") else [])
    if failed:
        check.print_result(fail_detail=True)
        sys.exit(f"{path.name}: crsdcheck is not content")
    print(f"{path.name}: {len(check.passes())} checks passed, none failed; {vectors} vectors of {case.samples} samples, {case.format}")


def main():
    folder = pathlib.Path(sys.argv[1])
    cases = [Noise(), Unbalanced(), Clipped()] if sys.argv[2:] == ["defects"] else [Plain(), Falling(), Spaceborne()]
    for seed, case in enumerate(cases):
        write(folder / f"{type(case).__name__.lower()}.crsd", case, seed)


main()
