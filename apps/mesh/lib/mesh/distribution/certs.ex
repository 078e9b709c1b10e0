defmodule Mesh.Distribution.Certs do
  @moduledoc """
  Makes a fleet's own certificates, for distribution by TLS: a CA, and a key and a certificate for each robot, made by
  the program `openssl` on the machine of the fleet's owner.

      certs/ca.pem  certs/ca-key.pem            the CA; its key (mode 0600) goes to no robot
      certs/mag1/{ca,cert,key}.pem              goes to mag1
      certs/mag1/ssl_dist.conf                  -ssl_dist_optfile of mag1

  Keys are EC P-256. The CA is valid for ten years, a robot's certificate for five, both from the
  moment they are made, so a robot's clock must not be earlier. CN and SAN are the robot's name.
  """

  @ca_days 3_650
  @robot_days 1_825

  @doc "Makes the CA in a folder, unless it exists."
  @spec ca(Path.t()) :: {:ok, :made | :kept} | {:error, String.t()}
  def ca(folder) do
    [certificate, key] = for file <- ["ca.pem", "ca-key.pem"], do: Path.join(folder, file)

    case {File.exists?(certificate), File.exists?(key)} do
      {true, true} -> {:ok, :kept}
      {false, false} -> make_ca(folder, certificate, key)
      {true, false} -> {:error, "#{folder} has a ca.pem, but not its key ca-key.pem"}
      {false, true} -> {:error, "#{folder} has a ca-key.pem, but not its certificate ca.pem"}
    end
  end

  @doc """
  Makes key, certificate and options of one robot, unless they exist; `force` replaces them.
  """
  @spec robot(Path.t(), name :: String.t(), force? :: boolean()) ::
          {:ok, :made | :kept} | {:error, String.t()}
  def robot(folder, name, force?) do
    own = Path.join(folder, name)

    cond do
      not name?(name) -> {:error, "#{inspect(name)} is not a robot's name; names are as mag1"}
      File.exists?(Path.join(own, "cert.pem")) and not force? -> {:ok, :kept}
      true -> make_robot(folder, own, name)
    end
  end

  @doc """
  Whether a text can be a robot's name: it becomes the name of a folder and of a certificate.

      iex> Enum.map(["mag1", "../mag1", ""], &Mesh.Distribution.Certs.name?/1)
      [true, false, false]
  """
  @spec name?(String.t()) :: boolean()
  def name?(name), do: String.match?(name, ~r/\A[a-z][a-z0-9_]{0,30}\z/)

  defp make_ca(folder, certificate, key) do
    with :ok <- private(folder) do
      openssl(
        ~w(req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout) ++
          [
            key,
            "-out",
            certificate,
            "-days",
            "#{@ca_days}",
            "-subj",
            "/CN=Convoy fleet #{random(4)}"
          ] ++
          ~w(-addext basicConstraints=critical,CA:TRUE,pathlen:0
             -addext keyUsage=critical,keyCertSign,cRLSign),
        [key]
      )
    end
  end

  defp make_robot(folder, own, name) do
    [key, request, certificate, extensions] =
      for file <- ["key.pem", "request", "cert.pem", "extensions"], do: Path.join(own, file)

    with :ok <- private(own),
         :ok <- write(extensions, extensions(name)),
         {:ok, :made} <-
           openssl(
             ~w(req -new -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout) ++
               [key, "-out", request, "-subj", "/CN=#{name}"],
             [key]
           ),
         {:ok, :made} <-
           openssl(
             ["x509", "-req", "-in", request, "-CA", Path.join(folder, "ca.pem"), "-CAkey"] ++
               [Path.join(folder, "ca-key.pem"), "-set_serial", "0x#{random(16)}"] ++
               ["-days", "#{@robot_days}", "-extfile", extensions, "-out", certificate],
             []
           ),
         :ok <- copy(Path.join(folder, "ca.pem"), Path.join(own, "ca.pem")),
         :ok <- write(Path.join(own, "ssl_dist.conf"), options(Path.expand(own))) do
      Enum.each([request, extensions], &File.rm/1)
      {:ok, :made}
    end
  end

  defp extensions(name) do
    """
    basicConstraints=critical,CA:FALSE
    keyUsage=critical,digitalSignature
    extendedKeyUsage=serverAuth,clientAuth
    subjectAltName=DNS:#{name}
    """
  end

  # An Erlang expression. Both sides show a certificate and check the other's. The names in them
  # are not compared with host names, because addresses of robots change. The folder may be copied
  # elsewhere; `CONVOY_CERTS_DIR` then says where it is.
  defp options(own) do
    common = """
    {cacertfile, os:getenv("CONVOY_CERTS_DIR", #{erlang(own)}) ++ "/ca.pem"},
          {certfile, os:getenv("CONVOY_CERTS_DIR", #{erlang(own)}) ++ "/cert.pem"},
          {keyfile, os:getenv("CONVOY_CERTS_DIR", #{erlang(own)}) ++ "/key.pem"},
          {verify, verify_peer},
          {verify_fun, {fun '#{Mesh.Distribution.ConnectionLog.Peer}':verify/3, []}},
          {versions, ['tlsv1.3', 'tlsv1.2']},
          {secure_renegotiate, true},
    """

    """
    %% -*- coding: utf-8 -*-
    [{server, [
          #{common}      {fail_if_no_peer_cert, true},
          {client_renegotiation, false}]},
     {client, [
          #{common}      {depth, 1}]}].
    """
  end

  defp erlang(text), do: :io_lib.format(~c"~tp", [String.to_charlist(text)])

  defp private(folder) do
    with :ok <- File.mkdir_p(folder), :ok <- File.chmod(folder, 0o700) do
      :ok
    else
      {:error, reason} -> cannot(folder, reason)
    end
  end

  defp write(path, text),
    do: with({:error, reason} <- File.write(path, text), do: cannot(path, reason))

  defp copy(from, to),
    do: with({:error, reason} <- File.cp(from, to), do: cannot(to, reason))

  defp cannot(path, reason),
    do: {:error, "#{path} cannot be written: #{:file.format_error(reason)}"}

  defp openssl(words, keys) do
    with program when is_binary(program) <- System.find_executable("openssl"),
         {_output, 0} <- System.cmd(program, words, stderr_to_stdout: true) do
      Enum.each(keys, &File.chmod(&1, 0o600))
      {:ok, :made}
    else
      nil ->
        {:error, "the program openssl is missing; on Debian: apt-get install openssl"}

      {output, _status} ->
        {:error,
         "openssl #{hd(words)} failed: #{output |> String.trim() |> String.split("\n") |> List.last()}"}
    end
  end

  # Serial numbers are positive.
  defp random(bytes) do
    <<first, rest::binary>> = :crypto.strong_rand_bytes(bytes)
    Base.encode16(<<rem(first, 127) + 1, rest::binary>>)
  end
end
