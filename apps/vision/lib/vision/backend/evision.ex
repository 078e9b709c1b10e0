if Code.ensure_loaded?(Evision) do
  defmodule Vision.Backend.Evision do
    @moduledoc """
    Regions by OpenCV, through evision: `inRange` for each class, then `connectedComponentsWithStats`.

    OpenCV knows no masks of many bits, so where the boxes of classes overlap, the picture of the
    first class is first split by the others into those of one mask each. That takes more calls, but
    only for classes that do overlap.

    It is for programs that build a pipeline of OpenCV anyway, and want this answer beside it: as a mere
    blob finder it is far slower than `Vision.Backend.Native` (docs/packages.md).
    """
    @behaviour Vision.Backend
    alias Hal.Frame
    alias Vision.Colours

    @formats [:yuyv, :i420, :nv12, :yuv444]
    @channels [:y, :u, :v]

    @impl Vision.Backend
    def reads?(format), do: format in @formats

    @impl Vision.Backend
    def regions(%Frame{} = frame, %Colours{classes: classes} = colours) do
      picture = picture(frame)
      inside = for class <- classes, do: {class, in_box(picture, class)}

      found =
        for {image, k} <- Enum.with_index(inside),
            part <- parts(image, Enum.split(inside, k)),
            {region, _first} = found <- components(part, k),
            allowed?(elem(region, 1), colours),
            do: found

      {:ok, order(found)}
    end

    @doc "A frame as OpenCV's picture of three channels Y, U and V, eight bits each."
    @spec picture(Frame.t()) :: Evision.Mat.t()
    def picture(%Frame{format: format, width: w, height: h, bytes: bytes}),
      do: %Evision.Mat{} = Evision.merge(planes(format, bytes, w, h))

    defp planes(:yuyv, bytes, w, h) do
      pairs = mat(bytes, div(w, 2), h, 4)
      chroma = for channel <- [1, 3], do: enlarge(Evision.extractChannel(pairs, channel), w, h)
      [Evision.extractChannel(mat(bytes, w, h, 2), 0) | chroma]
    end

    defp planes(:i420, bytes, w, h) do
      quarter = div(w * h, 4)
      <<y::binary-size(w * h), u::binary-size(quarter), v::binary-size(quarter)>> = bytes
      [mat(y, w, h, 1) | for(c <- [u, v], do: enlarge(mat(c, div(w, 2), div(h, 2), 1), w, h))]
    end

    defp planes(:nv12, bytes, w, h) do
      <<y::binary-size(w * h), chroma::binary>> = bytes
      chroma = mat(chroma, div(w, 2), div(h, 2), 2)
      [mat(y, w, h, 1) | for(c <- [0, 1], do: enlarge(Evision.extractChannel(chroma, c), w, h))]
    end

    defp planes(:yuv444, bytes, w, h),
      do: for(<<plane::binary-size(w * h) <- bytes>>, do: mat(plane, w, h, 1))

    defp mat(bytes, w, h, channels), do: Evision.Mat.from_binary(bytes, {:u, 8}, h, w, channels)

    # One value of chroma for each pixel that shares it.
    defp enlarge(mat, w, h),
      do: Evision.resize(mat, {w, h}, interpolation: Evision.Constant.cv_INTER_NEAREST())

    defp in_box(picture, class) do
      [lowest, highest] = for end_of <- [0, 1], do: corner(class, end_of)
      %Evision.Mat{} = Evision.inRange(picture, lowest, highest)
    end

    defp corner(class, end_of),
      do: @channels |> Enum.map(&elem(class[&1], end_of)) |> List.to_tuple()

    # The pixels whose lowest class is this one, in pictures of one mask each.
    defp parts({class, image}, {before, [_itself | later]}) do
      before = for {other, taken} <- before, overlap?(class, other), do: taken
      later = for {other, also} <- later, overlap?(class, other), do: also
      before |> Enum.reduce(image, &Evision.subtract(&2, &1)) |> split(later)
    end

    defp split(image, []), do: [image]

    defp split(image, [other | others]) do
      for part <- [Evision.Mat.bitwise_and(image, other), Evision.subtract(image, other)],
          Evision.countNonZero(part) > 0,
          whole <- split(part, others),
          do: whole
    end

    defp overlap?(a, b) do
      Enum.all?(@channels, fn channel ->
        {{a_lowest, a_highest}, {b_lowest, b_highest}} = {a[channel], b[channel]}
        a_lowest <= b_highest and b_lowest <= a_highest
      end)
    end

    # With each region a function that gives the column of its first pixel. Label 0 is the rest.
    defp components(image, k) do
      {count, labels, stats, centroids} =
        Evision.connectedComponentsWithStats(image, connectivity: 4)

      boxes = for <<box::binary-size(20) <- Evision.Mat.to_binary(stats)>>, do: box
      centres = for <<centre::binary-size(16) <- Evision.Mat.to_binary(centroids)>>, do: centre

      for {label, box, centre} <- Enum.drop(Enum.zip([0..(count - 1), boxes, centres]), 1) do
        region = region(box, centre, k)
        {region, fn -> first(labels, elem(region, 5), label) end}
      end
    end

    # The sums of whole numbers are whole: what the division left over is rounded away.
    defp region(
           <<left::32-native, top::32-native, w::32-native, h::32-native, area::32-native>>,
           <<x::float-64-native, y::float-64-native>>,
           k
         ),
         do: {k, area, round(x * area), round(y * area), left, top, left + w - 1, top + h - 1}

    defp first(labels, row, label) do
      row = Evision.Mat.to_binary(labels[[row..row, :all]])
      Enum.find_index(for(<<at::32-native <- row>>, do: at), &(&1 == label))
    end

    defp allowed?(area, %Colours{min_area: least, max_area: most}),
      do: area >= least and (most == 0 or area <= most)

    # Two regions can share all but their first pixel, as a hook and what it goes round: only then the
    # labels are looked at.
    defp order(found) do
      found
      |> Enum.group_by(fn {{k, area, _, _, left, top, _, _}, _first} -> {k, -area, top, left} end)
      |> Enum.sort()
      |> Enum.flat_map(fn
        {_key, [{region, _first}]} -> [region]
        {_key, tied} -> Enum.map(Enum.sort_by(tied, fn {_, first} -> first.() end), &elem(&1, 0))
      end)
    end
  end
end
